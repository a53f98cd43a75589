"""What a job may use: memory and time that grow with its frames and with each attempt."""

import functools

from vermilion.app.frame_megapixels import frame_megapixels
from vermilion.app.orphaned_jobs import cancel_jobs, jobs_of_run, name_for
from vermilion.app.partition_limits import impossible_jobs, read_partitions, requests_of
from vermilion.app.unanswered_checks import keep_unanswered, without_names

#: With this begin the names or comments of all Slurm jobs that write into these results.
SLURM_NAME = name_for(R)


def growing(least, for_each_frame=0.0, for_rig=0.0, for_mono=0.0, for_rig_frames=0.0):
    """Memory (MB) or time (minutes) of a rule's jobs, doubled at each attempt after the first.

    Args:
        least: what a job asks for, however few its frames and however small its images.
        for_each_frame: so much more for each frame of its chunk, or else of its take.
        for_rig: so much more for each megapixel of one frame, all cameras of its take together.
        for_mono: so much more for each megapixel of its take's largest image.
        for_rig_frames: as `for_rig`, times its frames.
    """

    def amount(wildcards, attempt):
        asked = least
        if for_each_frame:
            asked += for_each_frame * frames_of_job(wildcards)
        if for_rig:
            asked += for_rig * sum(megapixels_of_job(wildcards))
        if for_mono:
            asked += for_mono * max(megapixels_of_job(wildcards), default=0.0)
        if for_rig_frames:
            asked += for_rig_frames * frames_of_job(wildcards) * sum(megapixels_of_job(wildcards))
        return int(asked) * 2 ** (attempt - 1)

    return amount


def frames_of_job(wildcards):
    """How many frames the job of these wildcards works on."""
    if "chunk" in wildcards.keys():
        return len(frames_in(wildcards.chunk))
    return len(take_of(wildcards).frames)


def megapixels_of_job(wildcards):
    """Megapixels of each camera's image, of its take; of the largest take of a job of several."""
    if "take" in wildcards.keys():
        return megapixels_of(take_of(wildcards))
    subject = wildcards.subject if "subject" in wildcards.keys() else None
    return max(map(megapixels_of, takes(subject=subject)), key=sum, default=[])


@functools.cache
def megapixels_of(take):
    """Megapixels of each camera's image of a take; headers are read once a run."""
    return frame_megapixels(take, CONFIG.studio, CONFIG.capture.reading)


def on_slurm():
    """Whether jobs go to Slurm, as is known when the run starts."""
    name = workflow.executor_plugin.name
    submits = getattr(workflow.executor_settings, "submit_cmd", None) or ""
    return name == "slurm" or (name == "cluster-generic" and "sbatch" in submits)


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
