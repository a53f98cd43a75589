"""Two states of jobs that the Slurm plugin (2.8) does not understand: the run would wait for ever for them.

It forgets all jobs that it asked about while the controller did not answer; and it does not know that a job ended of
which the accounting database says who cancelled it (`CANCELLED by 1000`).
"""

from __future__ import annotations

from collections.abc import AsyncIterator
from typing import Any


def without_names(query: Any) -> Any:
    """The plugin's question for states, with the first word of each answer.

    Args:
        query: called with a command and a logger; gives (number of a job -> state, or None; seconds).
    """

    async def shortened(command: str, logger: Any) -> tuple[dict[str, str] | None, float | None]:
        states, seconds = await query(command, logger)
        if states is None:
            return states, seconds
        return {number: state.partition(" ")[0] for number, state in states.items()}, seconds

    return shortened


def keep_unanswered(executor: Any) -> None:
    """Change an executor of Snakemake so that a job stays active until its end was reported.

    Args:
        executor: has `check_active_jobs`, which yields the jobs that go on, and reports those that have ended
            by `report_job_success` and `report_job_error`.
    """
    check = executor.check_active_jobs
    ended: set[int] = set()

    def noting(report: Any) -> Any:
        def noted(job: Any, *arguments: Any, **options: Any) -> None:
            ended.add(id(job))
            report(job, *arguments, **options)

        return noted

    async def check_all(active: list[Any]) -> AsyncIterator[Any]:
        ended.clear()
        going_on: set[int] = set()
        async for job in check(active):
            going_on.add(id(job))
            yield job
        for job in active:
            if id(job) not in going_on | ended:
                yield job

    executor.report_job_success = noting(executor.report_job_success)
    executor.report_job_error = noting(executor.report_job_error)
    executor.check_active_jobs = check_all
