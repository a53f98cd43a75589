"""Another tracker's sequences as the base: lip motion that PS and MS leave, beside base and `null`.

Takes a finished run of the studio's captures, tracks its takes with a simulated tracker of another make
(`foreign_tracker`), and runs the workflow with these sequences as the base; what comes before the
tracking is shared with the finished run. Prints the motion error of the lips (`lip_motion_error_mm`, over
the vermilion) of every regressor as a ratio to the base, and beside `null`. Bars: MS at most 0.6 of the
base and 0.8 of `null`. With `--weights` the sequences come with the tracker's own blend weights.
"""

from __future__ import annotations

import argparse
import csv
import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml

from benchmarks.foreign_tracker import ForeignTracker, write_objs
from vermilion.config.takes import Take, read_takes
from vermilion.export.weights import write_weights
from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import read_cameras
from vermilion.storage.tables import read_table

#: Folders of a take that do not depend on the base.
SHARED = ("capture", "cameras", "landmarks", "multiview", "inpaint")
ROWS = ("base", "null", "null/neutral", "PS", "MS", "GR", "GR/neutral", "oracle")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the benchmark."""
    parser.add_argument("--config", type=Path, default=Path("config/config.yaml"))
    parser.add_argument(
        "--results", type=Path, help="the finished run of that configuration; default: its results"
    )
    parser.add_argument("--out", type=Path, required=True, help="folder to write to")
    parser.add_argument("--weights", action="store_true", help="with the tracker's blend weights")
    parser.add_argument("--cores", type=int, default=1)
    parser.add_argument("--only-make", action="store_true", help="write what is to run, and stop")


def share(source: Path, target: Path) -> None:
    """What comes before the base, of a finished run, with its times: links where that can be."""

    def copy(one: str, other: str) -> None:
        try:
            os.link(one, other)
        except OSError:
            shutil.copy2(one, other)

    shutil.copy2(source / "checksums.tsv", target / "checksums.tsv")
    names = ["captures", "truth", "face_model", "landmarks"]
    folders = [source / name for name in names if (source / name).is_dir()]
    folders += [
        folder for take in source.glob("takes/*/*") for folder in map(take.joinpath, SHARED)
        if folder.is_dir()
    ]  # fmt: skip
    for folder in folders:
        place = target / folder.relative_to(source)
        shutil.copytree(folder, place, copy_function=copy, dirs_exist_ok=True)
    for path in [
        *source.glob("subjects/*/plain_texture.exr"),
        *source.glob("subjects/*/overlay/*"),
    ]:
        place = target / path.relative_to(source)
        place.parent.mkdir(parents=True, exist_ok=True)
        if not place.exists():
            copy(str(path), str(place))


def tracked_row(results: Path, out: Path, take: Take, tracker: ForeignTracker, camera: str) -> Take:
    """Track a take with the simulated tracker; the row of its sequence."""
    truth = results / "truth" / take.name
    cameras = read_cameras(results / "takes" / take.name / "cameras")
    person = int.from_bytes(take.subject.encode(), "little") % 2**31
    meshes, weights, names = tracker.track(
        np.load(truth / "vertices_mm.npy"), np.load(truth / "neutral_mm.npy"),
        cameras[camera if camera in cameras else next(iter(cameras))],
        seed=person + len(take.take), person=person,
    )  # fmt: skip
    folder = out / "tracks" / take.name
    write_objs(folder, meshes, tracker.triangles, take.first)
    frames = np.array(take.frames)
    write_weights(
        folder.with_suffix(".csv"), frames, take.fps, names, weights, np.ones(len(frames), bool)
    )
    return Take(
        take.subject, f"{take.take}_other", "tracked", str(folder), take.first, take.last,
        take.fps, "none", of=take.take,
    )  # fmt: skip


def write_sheet(path: Path, takes: list[Take]) -> None:
    """The take sheet with the rows of the sequences."""
    columns = ("subject", "take", "role", "source", "first", "last", "fps", "split", "of")
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, delimiter="\t", lineterminator="\n")
        writer.writerow(columns)
        writer.writerows([[getattr(take, name) for name in columns] for take in takes])


def of_external_base(content: Mapping[str, Any], out: Path, weights: bool) -> dict[str, Any]:
    """The configuration of the run with these sequences."""
    apply = {**content.get("apply", {}), "export": {"formats": ["usd", "obj"]}}
    made = {
        **content, "results": str(out / "results"), "takes": str(out / "takes.tsv"), "apply": apply,
    }  # fmt: skip
    evaluation = content.get("evaluation", {})
    made["evaluation"] = {key: evaluation[key] for key in evaluation if "variants" not in key}
    if weights:
        pattern = str(out / "tracks" / "{subject}" / "{of}.csv")
        made["tracking"] = {
            **content.get("tracking", {}), "external": {"base": {"weights": pattern}},
        }  # fmt: skip
    return made


def run(arguments: argparse.Namespace) -> None:
    """Write the sequences and the configuration, run the workflow, print the figures."""
    content = yaml.safe_load(arguments.config.read_text())
    results, out = arguments.results or Path(content["results"]), arguments.out
    out.mkdir(parents=True, exist_ok=True)
    takes, problems = read_takes(content["takes"])
    assert not problems, problems
    (out / "results").mkdir(exist_ok=True)
    share(results, out / "results")
    tracker = ForeignTracker.of(FaceModel.load(results / "face_model" / "studio.npz"))
    frontal = content.get("capture", {}).get("frontal_camera", "face2")
    people = content.get("landmarks", {}).get("training_takes", [])
    based = [t for t in takes if t.role in ("tattoo", "video") and t.name not in people]
    rows = [tracked_row(results, out, take, tracker, frontal) for take in based]
    write_sheet(out / "takes.tsv", takes + rows)
    configuration = out / "external.yaml"
    configuration.write_text(
        yaml.safe_dump(of_external_base(content, out, arguments.weights), sort_keys=False)
    )
    command = [
        sys.executable, "-m", "snakemake", "--cores", str(arguments.cores), "--keep-going",
        "--configfile", str(configuration), "--rerun-triggers", "mtime",
    ]  # fmt: skip
    print(" ".join(command))
    if not arguments.only_make:
        subprocess.run(command, check=True)
        print(figures(out / "results" / "evaluation" / "measures.tsv").to_string())


def figures(path: Path) -> pd.DataFrame:
    """Motion error of the lips over all takes, and its ratios to the base and to `null`, by regressor."""
    table = read_table(path)
    chosen = table[(table["measure"] == "lip_motion_error_mm") & (table["region"] == "vermilion")]
    chosen = chosen[(chosen["subject"] == "all") & (chosen["take"] == "all")]
    motion = chosen.set_index("regressor")["value"]
    motion = motion.loc[[name for name in ROWS if name in motion.index]]
    return pd.DataFrame(
        {
            "lip_motion_mm": motion,
            "of_base": motion / motion["base"],
            "of_null": motion / motion["null"],
        }
    ).round(3)
