"""What a run began with: its later jobs use that configuration, and refuse to run other code.

The jobs of a long run start hours after it. Each reads the workflow and the library anew, while Snakemake
records the parameters of the beginning for what the jobs write. Without this, an edit in between
would give results of other code under the same name, and nobody would notice.
"""

from __future__ import annotations

import hashlib
import json
import os
import sys
import time
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from vermilion.provenance.fingerprint import SOURCE, fingerprint
from vermilion.storage.files import sha256_of, write_text
from vermilion.storage.json_files import load_json
from vermilion.storage.logfile import log_to

#: Environment variable with the path of the file that `record_beginning` writes; jobs inherit it.
VARIABLE = "VERMILION_RUN"
#: What was written for runs that began longer ago is removed.
_KEPT_DAYS = 60


@dataclass(frozen=True)
class BegunRun:
    """The beginning of a run.

    Attributes:
        configuration: the merged configuration, with what the command line said.
        takes: path of a copy of the take sheet.
        rules: digest of the rule files.
        code: script (`stage/rule`) -> fingerprint.
        stamp: sizes and times of the scripts and of the library's files, as a digest.
    """

    configuration: dict[str, Any]
    takes: str
    rules: str
    code: dict[str, str]
    stamp: str


def record_beginning(folder: Path, begun: BegunRun) -> Path:
    """Write the beginning of a run for its jobs, and set their environment variable.

    Args:
        folder: where it is written, with a copy of the take sheet that `begun.takes` names.
        begun: the beginning.
    """
    _forget_old(folder)
    sheet = Path(begun.takes)
    copy = folder / f"{sha256_of(sheet)[:16]}{sheet.suffix}"
    write_text(copy, sheet.read_text(encoding="utf-8"))
    text = json.dumps({**asdict(begun), "takes": str(copy.absolute())}, default=str)
    path = (folder / f"{hashlib.sha256(text.encode()).hexdigest()[:16]}.json").absolute()
    write_text(path, text)
    os.environ[VARIABLE] = str(path)
    return path


def of_this_job() -> BegunRun | None:
    """The beginning of the run that this process is a job of; None where nobody recorded it."""
    path = os.environ.get(VARIABLE)
    if not path or not Path(path).is_file():
        return None
    return BegunRun(**load_json(path))


def begin_job(log: str | Path, script: str | Path, code: str) -> None:
    """What each script does first: its output goes to its log; it ends where its code is another by now.

    Args:
        log: see `log_to`.
        script: path of the script.
        code: fingerprint of the script when the run began.
    """
    log_to(log)
    refuse_other_code(Path(script), code)


def refuse_other_code(script: Path, expected: str) -> None:
    """End this process where its code is not that of the run's beginning.

    Args:
        script: the script that this process runs.
        expected: its fingerprint at the beginning.
    """
    begun = of_this_job()
    if begun is None or not script.is_file() or begun.stamp == stamp_of(script.parents[1]):
        return
    if fingerprint(script) == expected:
        return
    sentence = (
        f"{script.name}: its code, or a module that it imports, changed after the run had begun. "
        "Nothing was written. Run the same command again: it makes what the change concerns."
    )
    print(f"\n{sentence}\n", file=sys.__stderr__, flush=True)
    sys.exit(sentence)


def digest_of(files: Iterable[Path]) -> str:
    """Digest of the contents of some files, in the order of their names."""
    together = hashlib.sha256()
    for path in sorted(files):
        together.update(f"{path.name} {sha256_of(path)}\n".encode())
    return together.hexdigest()[:16]


def stamp_of(scripts: Path, source: Path = SOURCE) -> str:
    """Sizes and times of all scripts and modules, as a digest: quicker than a fingerprint.

    Args:
        scripts: folder of the stages' scripts.
        source: folder of the library.
    """
    together = hashlib.sha256()
    for path in sorted([*scripts.rglob("*.py"), *source.rglob("*.py")]):
        state = path.stat()
        together.update(f"{path} {state.st_size} {state.st_mtime_ns}\n".encode())
    return together.hexdigest()[:16]


def with_beginning(configuration: Mapping[str, Any], begun: BegunRun | None) -> dict[str, Any]:
    """The configuration that a job uses: that of the run's beginning, with the sheet's copy."""
    if begun is None:
        return dict(configuration)
    return {**begun.configuration, "takes": begun.takes}


def _forget_old(folder: Path) -> None:
    for path in folder.glob("*"):
        if time.time() - path.stat().st_mtime > _KEPT_DAYS * 86400:
            path.unlink(missing_ok=True)
