"""Send what a job prints, and its traceback, to its log file."""

from __future__ import annotations

import contextlib
import sys
import traceback
from pathlib import Path
from types import TracebackType

from vermilion.storage.errors import VermilionError
from vermilion.storage.lifetime import end_with_run
from vermilion.storage.unwritable import explain

#: Beside the log of a job that failed: why, as one paragraph.
FAILED_SUFFIX = ".failed"


def log_to(path: str | Path) -> None:
    """Redirect standard output and error of this process to `path`, line by line.

    An uncaught error is written to the log and, as one paragraph, to the terminal: a user should
    not need to look for the log to learn which frame failed. The paragraph is also kept beside the log
    (`FAILED_SUFFIX`) until the job runs again.
    """
    end_with_run()
    terminal, log = sys.stderr, Path(path)
    failed = Path(f"{path}{FAILED_SUFFIX}")
    try:
        log.parent.mkdir(parents=True, exist_ok=True)
        failed.unlink(missing_ok=True)
        stream = open(log, "w", buffering=1)  # noqa: SIM115 - open until the process ends
    except OSError as error:
        print(f"\n{explain(error, log)}\nLog: {log}\n", file=terminal, flush=True)
        sys.exit(1)
    sys.stdout = sys.stderr = stream

    def report(
        kind: type[BaseException], error: BaseException, trace: TracebackType | None
    ) -> None:
        # The log itself may not be written where the disk is full.
        told = explain(error, log) if isinstance(error, Exception) else error
        what = str(told) if isinstance(told, VermilionError) else f"{kind.__name__}: {told}"
        print(f"\n{what}\nLog: {path}\n", file=terminal, flush=True)
        with contextlib.suppress(OSError):  # where the disk is full, there is the terminal
            traceback.print_exception(kind, error, trace, file=stream)
            failed.write_text(what, encoding="utf-8")

    sys.excepthook = report
