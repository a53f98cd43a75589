"""Send what a job prints, and its traceback, to its log file."""

from __future__ import annotations

import sys
import traceback
from pathlib import Path
from types import TracebackType

from vermilion.storage.errors import VermilionError

#: Beside the log of a job that failed: why, as one paragraph.
FAILED_SUFFIX = ".failed"


def log_to(path: str | Path) -> None:
    """Redirect standard output and error of this process to `path`, line by line.

    An uncaught error is written to the log and, as one paragraph, to the terminal: a user should
    not need to look for the log to learn which frame failed. The paragraph is also kept beside the log
    (`FAILED_SUFFIX`) until the job runs again.
    """
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    failed = Path(f"{path}{FAILED_SUFFIX}")
    failed.unlink(missing_ok=True)
    terminal = sys.stderr
    stream = open(path, "w", buffering=1)  # noqa: SIM115 - open until the process ends
    sys.stdout = sys.stderr = stream

    def report(
        kind: type[BaseException], error: BaseException, trace: TracebackType | None
    ) -> None:
        traceback.print_exception(kind, error, trace, file=stream)
        what = str(error) if isinstance(error, VermilionError) else f"{kind.__name__}: {error}"
        print(f"\n{what}\nLog: {path}\n", file=terminal, flush=True)
        failed.write_text(what, encoding="utf-8")

    sys.excepthook = report
