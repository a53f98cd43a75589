"""What jobs ask a cluster for covers what they were measured to use."""

import re

import pandas as pd
import pytest

from tests.workflow.conftest import copy_project

#: Memory of the two processes of Snakemake round a script of a Slurm job.
SNAKEMAKE_MB = 270


def requests(printed):
    """Benchmark file -> (memory in MB, minutes) of every job that a dry run prints."""
    found = {}
    for block in re.split(r"\n(?:local)?rule ", printed):
        named = re.search(r"^    benchmark: (\S+)$", block, re.MULTILINE)
        memory = re.search(r"\bmem_mb=(\d+)", block)
        minutes = re.search(r"\bruntime=(\d+)", block)
        if named and memory and minutes:
            found[named[1]] = (int(memory[1]), int(minutes[1]))
    return found


@pytest.mark.slow
def test_every_job_asks_for_half_as_much_again_as_it_used(finished):
    run = finished.snakemake("--dry-run", "--forceall")
    asked = requests(run.stdout + run.stderr)
    assert len(asked) > 100
    short = []
    for name, (memory_mb, minutes) in asked.items():
        used = pd.read_csv(finished.folder / name, sep="\t", na_values="-").iloc[0]
        if memory_mb < 1.5 * used["max_rss"] + SNAKEMAKE_MB or 60 * minutes < 1.5 * used["s"]:
            short.append(f"{name}: asks for {memory_mb} MB, {minutes} min; used {used.to_dict()}")
    assert short == []


#: MB that jobs used on the tiny capture with images of four times the width and height.
USED_MB = {
    "cameras": 839, "capture": 352, "landmarks_views": 353, "multiview_refine": 791, "multiview_neutral": 699,
    "multiview_report": 706, "inpaint": 464, "appearance": 469, "correspondence": 572, "tracking_meshes": 483,
    "contour_detector": 526, "image_identity": 386, "features": 275, "residuals": 342,
}  # fmt: skip


@pytest.mark.slow
def test_what_jobs_ask_for_grows_with_the_images(tmp_path):
    project, asked = copy_project(tmp_path), {}
    sizes = {"face_size_px": (240, 300), "lip_size_px": (280, 224), "video_size_px": (320, 240)}
    for scale in (1, 4, 16):
        scaled = {name: [scale * side for side in size] for name, size in sizes.items()}
        project.edit_configuration(lambda content, new=scaled: content["studio"].update(new))
        run = project.snakemake("--dry-run")
        most = asked.setdefault(scale, {})
        for name, (memory_mb, _) in requests(run.stdout + run.stderr).items():
            rule = name.split("/benchmarks/")[1].split("/")[0]
            most[rule] = max(most.get(rule, 0), memory_mb)
    for rule, used_mb in USED_MB.items():
        once, twice = asked[4][rule] - asked[1][rule], asked[16][rule] - asked[4][rule]
        assert asked[4][rule] > 1.5 * used_mb + SNAKEMAKE_MB, rule
        assert once > 0 and twice == pytest.approx(16 * once, rel=0.05), rule  # by the pixels
