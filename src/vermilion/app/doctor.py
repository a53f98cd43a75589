"""What this machine has of what Vermilion needs."""

from __future__ import annotations

import importlib
import os
import re
import shutil
import sys
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Literal

from vermilion.app.face_files import REMEDY, VARIABLE, cache_folder
from vermilion.faces.ict_cache import cached_archive
from vermilion.landmarks.mediapipe import environment_python
from vermilion.storage.errors import InputError

LEAST_PYTHON = (3, 11)
LEAST_DISK_GB = 2.0
ENVIRONMENT = ".venv-mediapipe"
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
#: Packages whose import name is not the package's.
_IMPORTED_AS = {
    "opencv-contrib-python-headless": "cv2",
    "openimageio": "OpenImageIO",
    "pyyaml": "yaml",
    "robust-laplacian": "robust_laplacian",
    "scikit-learn": "sklearn",
    "usd-core": "pxr",
}
_MARKS = {"good": "  ", "optional": "- ", "missing": "! "}


@dataclass(frozen=True)
class Finding:
    """One line: what was looked at, whether it is there, what was found, what to do.

    `optional` is what some commands alone need.
    """

    what: str
    state: Literal["good", "optional", "missing"]
    found: str
    remedy: str = ""

    def __str__(self) -> str:
        remedy = f"\n     {self.remedy}" if self.remedy else ""
        return f"{_MARKS[self.state]}{self.what}: {self.found}{remedy}"


def findings(project: Path) -> list[Finding]:
    """All findings, in the order in which a newcomer needs them."""
    return [
        interpreter(),
        packages(),
        landmark_environment(project / ENVIRONMENT),
        face_files(),
        browser(),
        disk(project),
        cores(),
        Finding("ffmpeg", "good", "not needed: PyAV brings the codecs"),
    ]


def interpreter(version: tuple[int, ...] = sys.version_info[:3]) -> Finding:
    """The interpreter that runs this."""
    found = ".".join(str(part) for part in version)
    if version[:2] >= LEAST_PYTHON:
        return Finding("Python", "good", found)
    return Finding(
        "Python", "missing", found, "Install Python 3.11 or newer; `make setup PYTHON=...`."
    )


def packages() -> Finding:
    """Whether every package that the project declares can be imported."""
    broken = []
    for name in _declared():
        if name.startswith("snakemake-"):
            continue  # plugins; snakemake looks for them
        module = _IMPORTED_AS.get(name, name.replace("-", "_"))
        try:
            importlib.import_module(module)
        except Exception as error:  # a shared library that is absent raises what it likes
            broken.append(
                f"{name} ({str(error).splitlines()[0] if str(error) else type(error).__name__})"
            )
    if not broken:
        return Finding("packages", "good", f"{len(_declared())} can be imported")
    return Finding(
        "packages", "missing", ", ".join(broken),
        "`make clean setup` makes the environment anew; pymeshlab also needs libgl1 and libopengl0.",
    )  # fmt: skip


def landmark_environment(folder: Path) -> Finding:
    """The environment of the landmark network for real faces."""
    what = "landmarks of real faces (mediapipe)"
    try:
        environment_python(folder)
    except InputError as error:
        return Finding(
            what, "optional", error.brief,
            f"`make lips` does this itself, or run `tools/setup_landmarks.sh {ENVIRONMENT}` (Python 3.9 to "
            "3.12); rendered faces need none.",
        )  # fmt: skip
    return Finding(what, "good", str(folder))


def face_files() -> Finding:
    """Where the face model of `vermilion lips` comes from."""
    what = "face model of `vermilion lips`"
    if named := os.environ.get(VARIABLE, ""):
        there = named == "procedural" or Path(named).expanduser().exists()
        if there:
            return Finding(what, "good", f"{VARIABLE}={named}")
        return Finding(
            what, "missing", f"{VARIABLE}={named}, which is not there", "Correct or unset it."
        )
    kept = cached_archive(cache_folder())
    if kept.is_file():
        return Finding(what, "good", str(kept))
    return Finding(
        what, "optional", "not fetched yet",
        f"`vermilion lips` fetches ICT-FaceKit (MIT) once; offline, {REMEDY}. Without it the embedded model "
        "is used.",
    )  # fmt: skip


def browser() -> Finding:
    """A browser for the tests of pages."""
    paths = [path for name in BROWSERS if (path := shutil.which(name))]
    if paths:
        return Finding("browser", "good", paths[0])
    return Finding(
        "browser", "optional", "no Chromium on the path",
        "Pages open in any browser; the tests of pages need Chromium (`apt-get install chromium`).",
    )  # fmt: skip


def disk(project: Path) -> Finding:
    """Room for results."""
    free_gb = shutil.disk_usage(project).free / 1e9
    found = f"{free_gb:.1f} GB free"
    if free_gb >= LEAST_DISK_GB:
        return Finding("disk", "good", found)
    return Finding(
        "disk", "missing", found, f"A run needs {LEAST_DISK_GB:.0f} GB and more; make room."
    )


def cores() -> Finding:
    """Cores, which say how long a run takes."""
    return Finding("cores", "good", str(os.cpu_count() or 1))


def _declared() -> list[str]:
    """Names of the packages that the project needs, without its extras."""
    required = metadata.requires("vermilion") or []
    plain = [line for line in required if "extra ==" not in line]
    return [re.split(r"[\[<>=!~; ]", line, maxsplit=1)[0].lower() for line in plain]
