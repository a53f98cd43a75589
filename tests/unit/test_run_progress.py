"""The line of progress: stage, frames, frames a second, time left, and what failed."""

import io
import subprocess
import sys
import time

import pytest

from vermilion.app.run_progress import RunProgress
from vermilion.app.workflow import ProgressLine, run_workflow
from vermilion.storage.logfile import FAILED_SUFFIX

START = """Job stats:
job            count
-----------  -------
landmarks          2
image_fit          2
all                1
total              5

"""


def started(rule, jobid, log):
    return f"[now]\nrule {rule}:\n    input: a, b\n    log: {log}\n    jobid: {jobid}\n\n"


def fed(state, text, now_s):
    for line in text.splitlines(keepends=True):
        state.feed(line, now_s)
    return state


def test_the_line_names_stage_frames_rate_and_time_left(tmp_path):
    log = tmp_path / "landmarks.log"
    log.write_text(
        "landmarks: 10 of 100, 20.00 a second, 4 s left\nlandmarks: 40 of 100, 20.00 a second, 3 s left\n"
    )
    state = fed(
        RunProgress(expected_s=lambda rule: 10.0), START + started("landmarks", 3, log), 0.0
    )
    # 3 s of this job, one more of landmarks, two of image_fit, `all`: 10 s each.
    assert state.left_s(2.0) == 43.0
    assert state.line(2.0) == "[0/5] landmarks: 40 of 100 frames, 20 a second; about 45 s left"


def test_jobs_that_ended_correct_what_was_expected():
    state = fed(
        RunProgress(expected_s=lambda rule: 10.0), START + started("landmarks", 3, "none.log"), 0.0
    )
    fed(state, "Finished jobid: 3 (Rule: landmarks)\n1 of 5 steps (20%) done\n", 20.0)
    # The second of landmarks as the first, the rest at the pace that was seen: twice as long.
    assert state.left_s(20.0) == 20.0 + 2 * 20.0 + 20.0
    assert not state.running and state.line(20.0).startswith("[1/5]")


def test_two_cores_halve_the_time_left():
    one, two = (fed(RunProgress(expected_s=lambda rule: 8.0, cores=c), START, 0.0) for c in (1, 2))
    assert one.left_s(0.0) == 2 * two.left_s(0.0) == 40.0


def test_a_failed_job_is_named_with_its_reason_and_its_log(tmp_path):
    log = tmp_path / "x-1.log"
    (tmp_path / f"x-1.log{FAILED_SUFFIX}").write_text("frame 7: no face")
    said = START + started("landmarks", 3, log) + (
        f"Error in rule landmarks:\n    message: None\n    jobid: 3\n    log: {log} (check log file(s) for error details)\n"
    )  # fmt: skip
    words = [sys.executable, "-c", f"print({said!r}); raise SystemExit(1)"]
    terminal = io.StringIO()
    assert run_workflow(words, tmp_path / "logs/snakemake.log", stream=terminal) == 1
    assert "landmarks failed: frame 7: no face" in terminal.getvalue()
    assert f"Log: {log}" in terminal.getvalue()
    assert "Job stats:" in (tmp_path / "logs/snakemake.log").read_text()


def test_what_fails_before_any_job_is_said(tmp_path):
    words = [sys.executable, "-c", "print('WorkflowError: 2 problem(s)'); raise SystemExit(1)"]
    terminal = io.StringIO()
    run_workflow(words, tmp_path / "s.log", stream=terminal)
    assert "2 problem(s)" in terminal.getvalue()


PROBLEMS = [
    "2 problem(s) in the configuration:",
    "  1. mine.yaml, key a: x",
    "  2. mine.yaml, key b: y",
]
WHERE = 'in file "/v/workflow/rules/common.smk", line 56'


@pytest.mark.parametrize(
    "said",
    [
        [f"WorkflowError {WHERE}:", *PROBLEMS, '  File "/v/workflow/rules/common.smk", line 5, in x'],
        [
            f"InputFunctionException in rule a {WHERE}:", "Error:", "  WorkflowError:",
            *(f"    {line}" for line in PROBLEMS),
            "Wildcards:", "  take=a", "Traceback:", '  File "/v/workflow/rules/common.smk", line 5, in x',
        ],
    ],
)  # fmt: skip
def test_what_a_rule_file_says_is_said_without_where_it_stands(tmp_path, said):
    words = [sys.executable, "-c", f"print({chr(10).join(said)!r}); raise SystemExit(1)"]
    terminal = io.StringIO()
    run_workflow(words, tmp_path / "s.log", stream=terminal)
    shown = terminal.getvalue().strip().splitlines()
    assert shown[-4:] == [*PROBLEMS, f"Log: {tmp_path / 's.log'}"]
    assert not any(
        part in terminal.getvalue() for part in ("Traceback", "Wildcards", "WorkflowError")
    )


def test_an_error_in_a_rule_file_itself_is_told_with_its_place(tmp_path):
    said = [
        f"InputFunctionException {WHERE}:", "Error:", "  KeyError: 'x'", "Wildcards:", "Traceback:",
        '  File "/v/workflow/rules/common.smk", line 5, in x',
    ]  # fmt: skip
    words = [sys.executable, "-c", f"print({chr(10).join(said)!r}); raise SystemExit(1)"]
    terminal = io.StringIO()
    run_workflow(words, tmp_path / "s.log", stream=terminal)
    assert chr(10).join(said) in terminal.getvalue()


def test_without_a_terminal_a_line_a_stage():
    out = io.StringIO()
    line = ProgressLine(out)
    for now_s, text in (
        (0, "[1/9] a: 1 of 2"),
        (1, "[1/9] a: 2 of 2"),
        (2, "[2/9] b"),
        (40, "[2/9] b"),
    ):
        line.show(text, now_s)
    assert out.getvalue().splitlines() == ["[1/9] a: 1 of 2", "[2/9] b", "[2/9] b"]


def test_a_reason_that_a_full_disk_did_not_keep_is_still_told(tmp_path):
    log = tmp_path / "logs/apply/s1.log"
    code = (
        "import sys; print('rule apply:\\n    jobid: 3\\n\\nfile a.npy: found that the disk is full.\\n'"
        f"'Log: {log}\\n\\nError in rule apply:\\n    jobid: 3\\n    log: {log} (check log)'); sys.exit(1)"
    )
    terminal = io.StringIO()
    assert run_workflow([sys.executable, "-c", code], tmp_path / "s.log", stream=terminal) == 1
    assert "apply failed: file a.npy: found that the disk is full." in terminal.getvalue()


def test_snakemake_without_room_is_one_sentence(tmp_path):
    code = "raise OSError(28, 'No space left on device')"
    terminal = io.StringIO()
    assert run_workflow([sys.executable, "-c", code], tmp_path / "s.log", stream=terminal) == 1
    assert "found that the disk is full" in terminal.getvalue()
    assert "Traceback" not in terminal.getvalue()


def test_who_ends_the_command_ends_snakemake(tmp_path):
    """SIGTERM to the command alone: what it started is told, and its exit code is the command's."""
    child = "import signal, sys, time; signal.signal(15, lambda *_: sys.exit(7)); print('on', flush=True); time.sleep(60)"
    code = (
        "import sys; from pathlib import Path; from vermilion.app.workflow import run_workflow\n"
        f"sys.exit(run_workflow([sys.executable, '-c', {child!r}], Path({str(tmp_path / 's.log')!r})))"
    )
    run = subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.PIPE, text=True)
    for _ in range(600):
        if (tmp_path / "s.log").is_file() and (tmp_path / "s.log").read_text() == "on\n":
            break
        time.sleep(0.05)
    run.terminate()
    _, said = run.communicate(timeout=30)
    assert run.returncode == 7
    assert "Asked to end" in said
