"""One video, one command: write its configuration, run it, name the page."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from vermilion.app import place
from vermilion.app.face_files import (
    REMEDY,
    ModelChoice,
    cache_folder,
    face_model,
    face_model_before,
)
from vermilion.app.lip_regressor import check_regressor
from vermilion.app.lip_shot import LipShot, frames_of_shot, write_shot
from vermilion.app.lips_ending import ending
from vermilion.app.run import run_all
from vermilion.app.workflow import TELLING
from vermilion.config.regressors import GENERIC, generic_file
from vermilion.config.sheet_numbers import eye_distance_problem
from vermilion.config.takes import Take, read_takes
from vermilion.storage.errors import InputError, VermilionError

#: Rule -> seconds of a job: to start, and of each frame. For the time left alone.
SECONDS = {
    "face_model": (14.0, 0.0),
    "image_identity": (14.0, 0.0),
    "cameras": (2.0, 0.0),
    "capture": (2.0, 0.02),
    "landmarks": (3.0, 0.07),
    "contour_detector": (6.0, 0.0),
    "contours": (3.0, 0.1),
    "appearance": (25.0, 0.0),
    "image_fit": (3.0, 0.3),
    "features": (3.0, 0.04),
    "apply": (4.0, 0.25),
}


def correct_lips(
    video: str,
    *,
    model: str | None,
    scan: str | None,
    eye_distance: str | None = None,
    out: str | None,
    span: tuple[int | None, int | None],
    options: Sequence[str],
) -> int:
    """Run the workflow for one video.

    Args:
        video, model, scan: files of the user, from the folder that they are in. The model `generic` is that
            of the project's `models/` for the face model that is used.
        eye_distance: measured distance of the person's pupils, mm; None: the size is the face model's.
        out: folder of the results; None: results/lips/<clip> of the project.
        span: first and last frame; None where the file's counts.
        options: of Snakemake.

    Returns:
        exit status: 0 where the page was made.

    Raises:
        InputError: a file is not there, or the video cannot be read.
    """
    if not video:
        raise VermilionError(
            "Name a video: make lips VIDEO=clip.mp4 (or an image, or a folder of numbered images)."
        )
    asked = (("model", None if model == GENERIC else model), ("scan", scan))
    given = {name: _file(name, path) for name, path in asked if path}
    source = _file("video", video)
    folder = None if out is None else Path(out).expanduser().absolute()
    project = place.enter_project()
    shot = LipShot(source, "", {}, given.get("model"), given.get("scan"), *span)
    frames_of_shot(shot)  # a video that cannot be read stops here, before anything is fetched
    results = place.from_here(folder, project) if folder else f"results/lips/{shot.take}"
    shot = replace(shot, results=results, eye_distance_mm=_eye_distance(eye_distance, scan))
    face = face_model(before=face_model_before(shot.configuration), results=results)
    print(face.said, file=sys.stderr)
    if model == GENERIC:
        shot = replace(shot, model=_generic(face))
    if shot.model is not None:
        check_regressor(shot.model, face)
    n_frames, chunk = write_shot(replace(shot, face_model=face.section), os.cpu_count() or 1)
    frames = "1 frame" if n_frames == 1 else f"{n_frames} frames"
    print(f"{frames} of {source.name} -> {results}", file=sys.stderr)
    takes = _takes(Path(results) / "takes.tsv")
    configuration = str(Path(results) / "config.yaml")
    code, skipped = run_all(
        configuration, Path(results), takes, [*options, *_shared()], {},
        expected(n_frames, chunk), alone=True,
    )  # fmt: skip
    if skipped:  # why was printed when it failed
        print(f"Nothing was made of {source.name}.", file=sys.stderr)
        return code or 1
    if code == 0 and not TELLING.intersection(options):
        print("\n".join(ending(Path(results), takes[0], face, shot.model)))
    return code


def _takes(sheet: Path) -> list[Take]:
    """The takes of a sheet that was just written."""
    takes, problems = read_takes(str(sheet))
    if problems:
        raise InputError("; ".join(problems), "a take sheet", "Report this.")
    return takes


def _eye_distance(text: str | None, scan: str | None) -> float | None:
    """The user's EYES. Raises VermilionError where it is none, or there is a scan too."""
    if not text:
        return None
    if problem := eye_distance_problem(text):
        raise VermilionError(f"EYES: {problem} Correct it.")
    if scan:
        raise VermilionError("Give SCAN or EYES, not both: a scan has a size of its own.")
    return float(text)


def _shared() -> list[str]:
    """Options with which the built face model is kept in the cache and serves every clip."""
    folder = Path(os.environ.setdefault("SNAKEMAKE_OUTPUT_CACHE", str(cache_folder() / "built")))
    folder.mkdir(parents=True, exist_ok=True)
    return ["--cache", "face_model"]


def expected(n_frames: int, chunk: int) -> Callable[[str], float]:
    """Rule -> seconds that one of its jobs takes about, in chunks of so many frames."""
    frames = min(n_frames, chunk)

    def seconds(rule: str) -> float:
        start, each = SECONDS.get(rule, (2.0, 0.0))
        return start + each * frames

    return seconds


def _generic(face: ModelChoice) -> Path:
    """File of the generic regressor of a face model."""
    path = Path(generic_file(face.section["name"]))
    if not path.is_file():
        raise VermilionError(
            f"MODEL=generic needs ICT-FaceKit: there is no generic regressor of the face model {face.name}. "
            f"{REMEDY}, or leave MODEL out."
        )
    return path.absolute()


def _file(what: str, path: str) -> Path:
    whole = Path(path).expanduser().absolute()
    if not whole.exists():
        raise InputError(
            f"no file or folder {path}", f"a {what}", f"Correct the path of the {what}.", path=whole
        )
    return whole
