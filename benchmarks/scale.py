"""Planning at a facility's size: jobs, seconds and memory of the graph against its frames.

For every size a folder of captures is made whose images are empty files: only the graph is made, no job runs.
Prints, for each: jobs; core seconds and memory of planning everything, of a run in which nothing is to be
done, and of one after an image has changed; and how planning grows with the jobs.

    python -m benchmarks scale --frames 1000 10000 --subjects 10
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from itertools import pairwise
from pathlib import Path

import numpy as np
import yaml

from benchmarks.common import print_table
from vermilion.geometry.camera import look_at, pinhole, write_cameras

ROOT = Path(__file__).resolve().parents[1]
FACE_CAMERAS, MONOCULAR = 3, "cam"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Sizes of the captures."""
    parser.add_argument("--frames", type=int, nargs="+", default=[100, 1000, 10_000])
    parser.add_argument("--subjects", type=int, default=10, help="each with a rig take and a video")
    parser.add_argument(
        "--chunk", type=int, default=250, help="chunk_frames, as the profiles have it"
    )
    parser.add_argument("--folder", type=Path, help="to work in (a temporary one)")


def run(arguments: argparse.Namespace) -> None:
    """Measure every size."""
    rows = []
    for frames in arguments.frames:
        with tempfile.TemporaryDirectory(dir=arguments.folder) as folder:
            rows.append(measured(Path(folder), frames, arguments.subjects, arguments.chunk))
            print_table(rows)
    for before, after in pairwise(rows):
        growth = after["plan_core_s"] / before["plan_core_s"] / (after["jobs"] / before["jobs"])
        print(
            f"{before['frames']} > {after['frames']} frames: planning a job costs {growth:.2f} times as much"
        )


def measured(folder: Path, frames: int, subjects: int, chunk: int) -> dict[str, float]:
    """A row: everything planned, nothing to be done, one image changed."""
    make_project(folder, frames, subjects, chunk)
    printed, plan_s, plan_mb = planned(folder, "--dry-run")
    jobs = int(re.search(r"^total\s+(\d+)", printed, re.MULTILINE)[1])
    for outputs in re.findall(r"^    output: (.*)$", printed, re.MULTILINE):
        for name in outputs.split(", "):
            make_output(folder / name)
    left, idle_s, idle_mb = planned(folder, "--dry-run")
    assert "Nothing to be done" in left, left[-2000:]
    image = folder / "captures" / "p0" / "phone" / "frames" / MONOCULAR / "000000.png"
    image.write_bytes(b"changed")
    changed, image_s, _ = planned(folder, "--dry-run")
    return {
        "frames": frames, "jobs": jobs, "plan_core_s": plan_s, "plan_mb": plan_mb,
        "idle_core_s": idle_s, "idle_mb": idle_mb, "image_core_s": image_s,
        "image_jobs": int(re.search(r"^total\s+(\d+)", changed, re.MULTILINE)[1]),
    }  # fmt: skip


def make_project(folder: Path, frames: int, subjects: int, chunk: int) -> None:
    """Captures of empty images, a sheet and a configuration."""
    pose = look_at(np.array([0.0, 0.0, 900.0]), np.zeros(3), np.array([0.0, 1.0, 0.0]))
    rows = ["subject\ttake\trole\tsource\tfirst\tlast\tfps\tsplit"]
    each = frames // (2 * subjects)
    for n in range(subjects):
        for take, role, count in (
            ("plain", "plain", 1),
            ("rom", "tattoo", each),
            ("phone", "video", each),
        ):
            names = [MONOCULAR] if role == "video" else [f"face{k}" for k in range(FACE_CAMERAS)]
            source = folder / "captures" / f"p{n}" / take
            write_cameras(source / "cameras", {k: pinhole(k, 1e3, 640, 480, pose) for k in names})
            for name in names:
                images = source / "frames" / name
                images.mkdir(parents=True)
                for frame in range(count):
                    (images / f"{frame:06d}.png").touch()
            split = (
                f"test:{max(count - chunk, 1)}-{count - 1}"
                if role == "tattoo" and count > 1
                else "none"
            )
            rows.append(f"p{n}\t{take}\t{role}\t{source}\t0\t{count - 1}\t30\t{split}")
    (folder / "takes.tsv").write_text("\n".join(rows) + "\n")
    content = {
        "results": "results", "takes": "takes.tsv", "chunk_frames": chunk,
        "face_model": {"name": "procedural"}, "capture": {"frontal_camera": "face1"},
        "landmarks": {"detector": "mediapipe"},
        "apply": {"takes": [f"p{n}/phone" for n in range(subjects)]},
    }  # fmt: skip
    (folder / "config.yaml").write_text(yaml.safe_dump(content))
    shutil.copytree(ROOT / "profiles", folder / "profiles")
    (folder / ".venv-mediapipe").symlink_to(ROOT / ".venv-mediapipe")


def make_output(path: Path) -> None:
    """An empty result: a folder where the name has no suffix."""
    if path.suffix:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    else:
        path.mkdir(parents=True, exist_ok=True)


def planned(folder: Path, *options: str) -> tuple[str, float, float]:
    """(what Snakemake prints, its core seconds, its memory in MB)."""
    words = [sys.executable, "-m", "snakemake", "--snakefile", str(ROOT / "Snakefile")]
    words += ["--configfile", "config.yaml", "--cores", "1", *options]
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "src")}
    log = folder / "printed.txt"
    with log.open("w") as stream:
        process = subprocess.Popen(
            words, cwd=folder, stdout=stream, stderr=subprocess.STDOUT, env=environment
        )
        _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    printed = log.read_text()
    if process.returncode:
        raise SystemExit(f"{' '.join(options)}:\n{printed[-4000:]}")
    return printed, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024
