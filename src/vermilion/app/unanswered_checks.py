"""Jobs of a cluster are kept where a question about their state got no answer.

The Slurm plugin (2.8) forgets all jobs that it asked about while the controller did not answer: the run would
then wait for ever for jobs that have long ended.
"""

from __future__ import annotations

from collections.abc import AsyncIterator
from typing import Any


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
