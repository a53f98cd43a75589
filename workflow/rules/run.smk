"""What surrounds the jobs of a run: one run at a time, what killed runs left behind, checksums."""

import contextlib
import socket
import time

from snakemake.exceptions import LockException
from snakemake.output_index import OutputIndex
from snakemake.script import PythonScript

from vermilion.app.job_server import served
from vermilion.app.quick_lookup import remember_producers
from vermilion.provenance import checksums
from vermilion.provenance.cleaning import forget_remade
from vermilion.provenance.cut_folders import cut_folders
from vermilion.provenance.file_times import mend_future_times
from vermilion.provenance.run_lock import hold
from vermilion.storage.files import remove_result, remove_unfinished
from vermilion.storage.lifetime import RUN

#: Jobs of another machine may still write after their Snakemake was killed: their files are kept so long.
_REMOTE_JOBS_S = 24 * 3600

# A job ends when this process does.
os.environ[RUN] = str(os.getpid())


def alone(execute):
    """Snakemake's way to execute the jobs, for one process at a time in a folder of results."""

    def execute_alone(executor_plugin, *arguments, **options):
        if executor_plugin.common_settings.dryrun_exec:
            return execute(executor_plugin, *arguments, **options)
        try:
            with hold(Path(R)) as before:
                return _execute(execute, before, executor_plugin, *arguments, **options)
        except VermilionError as error:
            raise WorkflowError(str(error)) from None

    return execute_alone


def _execute(execute, before, executor_plugin, *arguments, **options):
    """Put in order what a killed run left behind; execute; leave nothing unfinished behind."""
    local = executor_plugin.common_settings.local_exec
    age_s = 0 if local else _REMOTE_JOBS_S
    if local:
        # The limit protects queues from many jobs at once; the cores of this machine limit by themselves. Under
        # it, each finished job adds a timer that looks at all ready jobs again and again until the run ends.
        workflow.scheduling_settings.max_jobs_per_timespan = None
    if before.was_killed:
        remove_stale_locks()
        remove_unfinished(R, age_s)
        for folder in cut_folders(Path(R)):
            remove_result(folder)
    try:
        with served(PythonScript, jobs_of_this_process) if local else contextlib.nullcontext():
            execute(executor_plugin, *arguments, **options)
    except LockException:
        if before.holder is None:
            raise
        raise WorkflowError(
            f"{R}: found a run that did not end ({before.holder}); expected one run at a time. It cannot be "
            f"seen from host {socket.gethostname()} whether it still runs. Where it does not, run the same "
            "command with --unlock, then without."
        ) from None
    finally:
        if before.was_killed or JOBS_STARTED:
            remove_unfinished(R, age_s)
    if before.was_killed and not JOBS_STARTED:
        record_checksums()  # what the killed run made and could not record


def jobs_of_this_process():
    """How many jobs are to be done."""
    return len(list(workflow.dag.needrun_jobs()))


def mend_clock():
    """Before any job: what was made before the clock was set back is no newer than now."""
    inputs = {Path(file) for job in workflow.dag.needrun_jobs() for file in job.input}
    try:
        mended = mend_future_times(Path(R), inputs, time.time())
    except VermilionError as error:
        raise WorkflowError(str(error)) from None
    if mended:
        print(
            f"{len(mended)} result(s) are from the future, such as {mended[0]}: their times are set to now",
            file=sys.stderr,
        )


def remove_stale_locks():
    """Remove Snakemake's locks on files of the results: their run is over."""
    for path in Path(".snakemake", "locks").glob("*.lock"):
        with open(path) as lines:
            if any(line.startswith(f"{R}/") for line in lines):
                path.unlink()


def record_checksums():
    """Write the ledger of checksums for every output whose job has ended."""
    if not IS_MAIN_PROCESS or workflow.dryrun:
        return
    # Snakemake may have read the record of its last job before it was written, and keeps what it read.
    workflow.persistence.deactivate_cache()
    jobs, ends = {}, {}
    for job in workflow.dag.jobs:
        for output in job.output:
            path = Path(output)
            if str(output).startswith(f"{R}/") and path.exists():
                jobs[path] = Path(job.output[0])
                ends[path] = getattr(workflow.persistence.metadata(output), "endtime", None)
    try:
        refused = checksums.update_ledger(Path(R), jobs, ends.get)
    except VermilionError as error:
        print(error, file=sys.stderr)
        return
    forget_remade(Path(R))
    for damage in refused:
        print(f"not to be trusted: {damage.path}: {damage.reason}", file=sys.stderr)


#: Filled when the first job of this run starts.
JOBS_STARTED = []

remember_producers(OutputIndex)

if IS_MAIN_PROCESS:
    workflow.execute = alone(workflow.execute)
