"""The generic regressor: run its configuration, and put the file where `generic` finds it."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from vermilion.app import place
from vermilion.app.run import results_folder, run_all
from vermilion.config.load import read_keys
from vermilion.config.regressors import GENERIC, generic_file
from vermilion.config.root import Configuration
from vermilion.config.takes import read_takes
from vermilion.storage.files import atomic_path

#: What a file says of the people that it was trained on.
NOTICES = {
    "ict": "Trained on synthetic people of ICT-FaceKit, Copyright (c) 2020 USC Institute for Creative "
    "Technologies, MIT licence: see LICENSE.ICT-FaceKit.",
}
#: A flag before it, as Snakemake takes what follows a configuration for one more.
_TARGET = ("--nocolor", GENERIC)


def make_generic(configuration: str, people: int | None, options: Sequence[str]) -> int:
    """Render, track and learn; then copy the regressor into `models/` of the project.

    Args:
        configuration: a YAML file, from the folder that the user is in.
        people: how many of the takes that train are used, from the first on; None: all.
        options: of Snakemake. With `-n` nothing is made or copied.

    Returns:
        exit status: 0 where the regressor was made.
    """
    whole = Path(configuration)
    whole = whole.absolute() if whole.is_file() else whole
    project = place.enter_project()
    path = place.from_here(whole, project) if whole.is_absolute() else configuration
    raw, results = read_keys(path), results_folder(path)
    takes, _ = read_takes(str(raw.get("takes", Configuration.model_fields["takes"].default)))
    trained = [take for take in takes if take.train_frames()]
    rest = trained[people:] if people else []
    skipped = {take.name: f"beyond the first {people} that train" for take in rest}
    skipped |= raw.get("skip_takes", {})
    code, _ = run_all(path, results, takes, [*_TARGET, *options], skipped)
    made = results / "models" / f"{GENERIC}.h5"
    if code or not made.is_file() or {"-n", "--dry-run"} & set(options):
        return code
    face = raw.get("face_model", {}).get("name", "procedural")
    shipped = Path(generic_file(face))
    ship(made, shipped, face, path)
    print(f"Regressor: {shipped}, {shipped.stat().st_size / 1e6:.1f} MB")
    return 0


def ship(made: Path, shipped: Path, face: str, configuration: str) -> None:
    """Copy a regressor and write into the copy what it was made from.

    Args:
        made: file of the run.
        shipped: the copy.
        face: name of the face model.
        configuration: path of the configuration.
    """
    import h5py

    with atomic_path(shipped) as temporary:
        shutil.copyfile(made, temporary)
        with h5py.File(temporary, "r+") as file:
            file.attrs["configuration"] = configuration
            file.attrs["commit"] = _commit()
            file.attrs["notice"] = NOTICES.get(face, "")


def _commit() -> str:
    """The commit of the project, with `+` where files differ from it; empty without git."""
    try:
        head, changed = (
            subprocess.run(
                ["git", *words], check=True, capture_output=True, text=True
            ).stdout.strip()
            for words in (["rev-parse", "HEAD"], ["status", "--porcelain", "--untracked-files=no"])
        )
    except (OSError, subprocess.CalledProcessError) as error:
        print(f"no commit is known: {error}", file=sys.stderr)
        return ""
    return head + ("+" if changed else "")
