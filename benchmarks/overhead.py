"""What the workflow costs beside the work: jobs of Snakemake against the same library calls in a loop.

The images of one synthetic take are rendered chunk by chunk, once by the workflow with one core (planning,
processes, imports, records), once more without its job server, once by a loop in one process. With the folder of
a finished run, prints also what share the cost of a job is of each rule's work at chunks of 100 frames.

    python -m benchmarks overhead --frames 100 --chunks 2
    python -m benchmarks overhead --frames 5 --chunks 24
    python -m benchmarks overhead --results results/sample
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path

import pandas as pd
import yaml

from benchmarks.common import print_table
from vermilion.app.job_server import SWITCH

ROOT = Path(__file__).resolve().parents[1]
#: Keys of a studio take that are its camera's.
OWN_CAMERA = {"camera_distance_mm", "video_view_mm"}
IMAGES = {
    "video_size_px": [320, 240],
    "occlusion_directions": 32,
    "light_samples": 2,
    "edge_samples": 2,
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The size of the take, and a finished run."""
    parser.add_argument("--frames", type=int, default=100, help="frames of a chunk (%(default)s)")
    parser.add_argument("--chunks", type=int, default=2, help="chunks of the take (%(default)s)")
    parser.add_argument("--results", type=Path, help="folder of a finished run")
    parser.add_argument("--folder", type=Path, help="to work in (a temporary one)")


def run(arguments: argparse.Namespace) -> None:
    """Measure both ways, then say what it means for each rule."""
    with tempfile.TemporaryDirectory(dir=arguments.folder) as name:
        folder = Path(name)
        make_project(folder, arguments.frames, arguments.chunks)
        spent(folder, "--until", "studio_rig_p_video")  # what all ways need
        idle_wall_s, idle_s = spent(folder, "--until", "studio_rig_p_video")
        alone = shutil.copytree(folder, folder / "alone", symlinks=True)
        workflow_wall_s, workflow_s = spent(folder)
        alone_wall_s, alone_s = spent(alone, server="off")
        loop_wall_s, loop_s = spent_in_a_loop(folder, arguments.frames, arguments.chunks)
    job_s = (workflow_s - idle_s - loop_s) / arguments.chunks
    rows = [
        {"way": "workflow", "wall_s": workflow_wall_s, "core_s": workflow_s},
        {"way": "workflow without job server", "wall_s": alone_wall_s, "core_s": alone_s},
        {"way": "loop", "wall_s": loop_wall_s, "core_s": loop_s},
        {"way": "workflow with nothing to do", "wall_s": idle_wall_s, "core_s": idle_s},
    ]
    print_table(rows)
    print(
        f"{arguments.chunks} chunks of {arguments.frames} frames: a job costs {job_s:.2f} core s beside its work, "
        f"{job_s * arguments.chunks / loop_s:.1%} of it; planning and records cost {idle_s:.1f} core s, once a run"
    )
    if arguments.results:
        print_table(share_of_rules(arguments.results, job_s), 3)


def make_project(folder: Path, frames: int, chunks: int) -> None:
    """A configuration of one synthetic video."""
    row = f"p\tvideo\tvideo\tstudio\t0\t{frames * chunks - 1}\t30\tnone"
    (folder / "takes.tsv").write_text(
        f"subject\ttake\trole\tsource\tfirst\tlast\tfps\tsplit\n{row}\n"
    )
    performance = {"seed": 1, "poses": 4, "pose_seconds": [0.5, 1.0]}
    content = {
        "results": "results", "takes": "takes.tsv", "chunk_frames": frames,
        "face_model": {"name": "procedural"}, "landmarks": {"detector": "mediapipe"},
        "apply": {"regressor": "none", "takes": ["p/video"]},
        "studio": {"subjects": {"p": {"seed": 3, "takes": {"video": performance}}}, **IMAGES},
    }  # fmt: skip
    (folder / "config.yaml").write_text(yaml.safe_dump(content))
    shutil.copytree(ROOT / "profiles", folder / "profiles")
    (folder / ".venv-mediapipe").symlink_to(ROOT / ".venv-mediapipe")


def spent(folder: Path, *options: str, cores: int = 1, server: str = "on") -> tuple[float, float]:
    """(Seconds, core seconds) of a run of the target `captures` with so many cores."""
    words = [sys.executable, "-m", "snakemake", "--snakefile", str(ROOT / "Snakefile")]
    words += ["--configfile", "config.yaml", "--cores", str(cores), "captures", *options]
    return spent_by(words, folder, {SWITCH: server})


def spent_in_a_loop(folder: Path, frames: int, chunks: int) -> tuple[float, float]:
    """(Seconds, core seconds) of a process that renders the same chunks by calls of the library."""
    words = [
        sys.executable,
        "-c",
        f"from benchmarks.overhead import loop; loop({frames}, {chunks})",
    ]
    return spent_by(words, folder)


def spent_by(
    words: list[str], folder: Path, variables: Mapping[str, str] | None = None
) -> tuple[float, float]:
    """(Seconds, core seconds) of a command with all that it starts, under some more variables."""
    environment = {**os.environ, "PYTHONPATH": f"{ROOT / 'src'}:{ROOT}", **(variables or {})}
    start = time.perf_counter()
    with (folder / "printed.txt").open("w") as stream:
        process = subprocess.Popen(
            words, cwd=folder, stdout=stream, stderr=subprocess.STDOUT, env=environment
        )
        _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit((folder / "printed.txt").read_text()[-4000:])
    return time.perf_counter() - start, used.ru_utime + used.ru_stime


def loop(frames: int, chunks: int) -> None:
    """Render the chunks of the take in the working folder, as one who calls the library would."""
    from vermilion.config.load import load_configuration, read_keys
    from vermilion.config.studio import StudioSubject
    from vermilion.faces.model import FaceModel
    from vermilion.geometry.camera import read_cameras
    from vermilion.studio.capture_writer import write_images
    from vermilion.studio.take import plan_take
    from vermilion.studio.take_settings import take_settings

    configuration, _ = load_configuration(read_keys("config.yaml"), "config.yaml")
    studio = configuration.studio
    subject = studio.subjects.get("p", StudioSubject())
    keys = ("identity_spread", "expression_spread", "seed", "slight_open", "ease_in_frames")
    keys += ("intensity", "head_turn_deg", "head_shift_mm")
    plan = plan_take(
        FaceModel.load("results/face_model/studio.npz"),
        take_settings({
            "role": "video", "first": 0, "last": frames * chunks - 1, "fps": 30,
            "actor": {"seed": subject.seed, "identity": subject.identity},
            "performance": subject.takes["video"].model_dump(mode="json", exclude=OWN_CAMERA),
            **{key: getattr(studio, key) for key in keys},
        }),
    )  # fmt: skip
    cameras = read_cameras(Path("results/captures/p/video/cameras"))
    images = ("occlusion_directions", "light_samples", "edge_samples", "noise_read", "noise_shot")
    for chunk in range(chunks):
        write_images(
            plan,
            cameras,
            Path("loop"),
            range(chunk * frames, (chunk + 1) * frames),
            0,
            name="p/video",
            seed=studio.seed,
            **{key: getattr(studio, key) for key in images},
        )
    for path in sorted(Path("loop").rglob("*.png")):
        made = Path("results/captures/p/video") / path.relative_to("loop")
        if made.read_bytes() != path.read_bytes():
            raise SystemExit(f"{path}: the loop does not render what the workflow does")


def share_of_rules(results: Path, job_s: float) -> pd.DataFrame:
    """Rules of a finished run that work by chunks: seconds a frame, and what a job costs beside 100 of them.

    Args:
        results: the run's results folder.
        job_s: core seconds that a job costs beside its work.
    """
    rows = []
    for folder in sorted((results / "benchmarks").iterdir()):
        files = [path for path in folder.glob("*.tsv") if path.stem.count("-") >= 3]
        spans = [path.stem.split("-")[-2:] for path in files]
        if not files or not all(part.isdigit() for span in spans for part in span):
            continue
        frames = sum(int(last) - int(first) + 1 for first, last in spans)
        table = pd.concat([pd.read_csv(path, sep="\t") for path in files])
        frame_s = max(table["cpu_time"].sum() / frames, 1e-9)
        rows.append({"rule": folder.name, "frames": frames, "frame_s": frame_s, "jobs": 1})
    rows.sort(key=lambda row: -row["frame_s"])
    total = sum(row["frame_s"] for row in rows)
    most = max(row["frames"] for row in rows)
    rows.append({"rule": "all of these", "frames": most, "frame_s": total, "jobs": len(rows)})
    shares = [{"job_share": row["jobs"] * job_s / (100 * row["frame_s"])} for row in rows]
    return pd.DataFrame([row | share for row, share in zip(rows, shares, strict=True)])
