"""A job stays active until its end was reported, whatever the cluster answers."""

import asyncio

from vermilion.app.unanswered_checks import keep_unanswered, without_names


class Executor:
    """An executor whose cluster answers as it is told."""

    def __init__(self):
        self.answer, self.reported = {}, []

    def report_job_success(self, job):
        self.reported.append((job, "success"))

    def report_job_error(self, job, msg=None):
        self.reported.append((job, msg))

    async def check_active_jobs(self, active):
        for job in active:
            state = self.answer.get(job)
            if state == "COMPLETED":
                self.report_job_success(job)
            elif state == "FAILED":
                self.report_job_error(job, msg="failed")
            elif state == "RUNNING":
                yield job


def still_active(executor, jobs):
    async def asked():
        return [job async for job in executor.check_active_jobs(jobs)]

    return asyncio.run(asked())


def test_jobs_without_an_answer_are_asked_for_again():
    executor = Executor()
    keep_unanswered(executor)
    assert still_active(executor, ["a", "b"]) == ["a", "b"]


def test_jobs_that_ended_are_not_and_jobs_that_go_on_come_once():
    executor = Executor()
    keep_unanswered(executor)
    executor.answer = {"a": "RUNNING", "b": "COMPLETED", "c": "FAILED"}
    assert still_active(executor, ["a", "b", "c", "d"]) == ["a", "d"]
    assert executor.reported == [("b", "success"), ("c", "failed")]
    executor.answer = {}
    assert still_active(executor, ["a", "d"]) == ["a", "d"]


def test_a_state_is_known_whoever_brought_it_about():
    async def query(command, logger):
        return ({"7": "CANCELLED by 1000", "8": "RUNNING"}, 0.1) if command else (None, None)

    assert asyncio.run(without_names(query)("sacct", None)) == (
        {"7": "CANCELLED", "8": "RUNNING"},
        0.1,
    )
    assert asyncio.run(without_names(query)("", None)) == (None, None)
