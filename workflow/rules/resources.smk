"""What a job may use: memory and time that grow with its frames and with each attempt."""

import functools

from vermilion.app.frame_megapixels import frame_megapixels
from vermilion.app.orphaned_jobs import cancel_jobs, jobs_of_run, name_for
from vermilion.app.partition_limits import impossible_jobs, read_partitions, requests_of
from vermilion.app.unanswered_checks import keep_unanswered, without_names

#: With this begin the names or comments of all Slurm jobs that write into these results.
SLURM_NAME = name_for(R)


def growing(least, for_each_frame=0.0, for_each_megapixel=0.0, for_all_megapixels=0.0):
    """Memory (MB) or time (minutes) of a rule's jobs, doubled at each attempt after the first.

    Args:
        least: what a job asks for, however few its frames and however small its images.
        for_each_frame: so much more for each frame of its chunk, or else of its take.
        for_each_megapixel: so much more for each megapixel of one frame, all cameras of its take together.
        for_all_megapixels: so much more for each megapixel of all its frames.
    """

    def amount(wildcards, attempt):
        asked = least
        if for_each_frame or for_all_megapixels:
            frames = frames_of_job(wildcards)
            asked += for_each_frame * frames
        if for_each_megapixel or for_all_megapixels:
            megapixels = megapixels_of_job(wildcards)
            asked += for_each_megapixel * megapixels
        if for_all_megapixels:
            asked += for_all_megapixels * frames * megapixels
        return int(asked) * 2 ** (attempt - 1)

    return amount


def frames_of_job(wildcards):
    """How many frames the job of these wildcards works on."""
    if "chunk" in wildcards.keys():
        return len(frames_in(wildcards.chunk))
    return len(take_of(wildcards).frames)


def megapixels_of_job(wildcards):
    """Megapixels of a frame of its take; of a subject's largest take where the job is the subject's."""
    if "take" in wildcards.keys():
        return _megapixels(take_of(wildcards))
    if "subject" in wildcards.keys():
        return max(map(_megapixels, takes(subject=wildcards.subject)), default=0.0)
    return max(map(_megapixels, TAKES), default=0.0)


@functools.cache
def _megapixels(take):
    return frame_megapixels(take, CONFIG.studio, CONFIG.capture.reading)


def on_slurm():
    """Whether jobs go to Slurm, as is known when the run starts."""
    return workflow.executor_plugin.name in ("slurm", "cluster-generic")


def refuse_impossible_jobs():
    """Before anything is submitted to Slurm: a sentence for each rule whose jobs could never start."""
    if not on_slurm():
        return
    sentences = impossible_jobs(requests_of(workflow.dag.needrun_jobs()), read_partitions())
    if sentences:
        raise WorkflowError("Some jobs could never start on this cluster:", *sentences)


def cancel_orphaned_jobs():
    """Cancel the Slurm jobs of a run that was killed: they would write into the same results as this one.

    This run holds Snakemake's lock, so no other one can be alive.
    """
    if not on_slurm():
        return
    orphans = jobs_of_run(SLURM_NAME)
    if orphans:
        print(
            f"Cancelling {len(orphans)} Slurm job(s) of an earlier run that was killed: "
            f"{', '.join(orphans)}",
            file=sys.stderr,
        )
        cancel_jobs(orphans)


def prepare_slurm():
    """Give the jobs of this run their name, and keep those about which Slurm does not answer."""
    if not on_slurm():
        return
    # The profile for plain sbatch puts this into each job's comment; the plugin gives jobs their run's name.
    os.environ["VERMILION_SLURM_NAME"] = SLURM_NAME
    executor = workflow.scheduler._executor
    if hasattr(executor, "run_uuid"):
        executor.run_uuid = f"{SLURM_NAME}_{executor.run_uuid}"
        keep_unanswered(executor)
        plugin = sys.modules[type(executor).__module__]
        plugin.query_job_status = without_names(plugin.query_job_status)
