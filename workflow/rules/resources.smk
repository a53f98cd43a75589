"""What a job may use: memory and time that grow with its frames and with each attempt."""

from vermilion.app.partition_limits import impossible_jobs, read_partitions, requests_of


def growing(least, for_each_frame=0.0):
    """Memory (MB) or time (minutes) of a rule's jobs, doubled at each attempt after the first.

    Args:
        least: what a job asks for, however few its frames.
        for_each_frame: so much more for each frame of its chunk, or else of its take.
    """

    def amount(wildcards, attempt):
        frames = frames_of_job(wildcards) if for_each_frame else 0
        return int(least + for_each_frame * frames) * 2 ** (attempt - 1)

    return amount


def frames_of_job(wildcards):
    """How many frames the job of these wildcards works on."""
    if "chunk" in wildcards.keys():
        return len(frames_in(wildcards.chunk))
    return len(take_of(wildcards).frames)


def refuse_impossible_jobs():
    """Before anything is submitted to Slurm: a sentence for each rule whose jobs could never start."""
    if workflow.executor_plugin.name not in ("slurm", "cluster-generic"):
        return
    sentences = impossible_jobs(requests_of(workflow.dag.needrun_jobs()), read_partitions())
    if sentences:
        raise WorkflowError("Some jobs could never start on this cluster:", *sentences)
