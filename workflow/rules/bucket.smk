"""Without a shared file system: results lie in a bucket, and a job finds only what its rule has as input.

Scripts open images by the folder of a take. In a bucket, the images that a job may open are therefore
inputs one by one; elsewhere the manifests that checked them are enough, and the graph stays small.
What the user gives (captures, scans, models of others) is never in the bucket: every job reads it by its
path, from the container's image or a volume that is mounted for reading.
"""

from snakemake.sourcecache import LocalSourceFile

from vermilion.app.bucket_files import mend_bucket_files

#: Whether the profile stores results in a bucket.
IN_BUCKET = bool(workflow.storage_settings.default_storage_provider)


def link_to_local_copies(results):
    """Where results lie in a bucket: their name leads to the local copies of what the job reads and writes.

    Snakemake gives scripts the paths of the copies; folders that stand in parameters are found by this.
    """
    if not IN_BUCKET:
        return
    settings = workflow.storage_settings
    place = settings.default_storage_prefix.partition("://")[2]
    copies = (
        Path(settings.local_storage_prefix) / settings.default_storage_provider / place / results
    )
    link = Path(results)
    if link.is_dir() and not link.is_symlink():
        raise WorkflowError(
            f"{results} is a folder of this machine, and the profile stores results in "
            f"{settings.default_storage_prefix}. Move it away, or name another folder by the key `results`."
        )
    link.parent.mkdir(parents=True, exist_ok=True)
    link.unlink(missing_ok=True)
    copies.mkdir(parents=True, exist_ok=True)
    link.symlink_to(copies.absolute())


def prepare_bucket(results):
    """Where results lie in a bucket: all other files of the graph are read where their paths lead."""
    if not IN_BUCKET:
        return
    mend_bucket_files(workflow.storage_registry.default_storage_provider.get_storage_object_cls())
    modifier = workflow.modifier.path_modifier
    to_bucket = modifier.apply_default_storage

    def results_to_bucket(path):
        return to_bucket(path) if str(path).startswith(f"{results}/") else path

    modifier.apply_default_storage = results_to_bucket


def send_with_sources(path):
    """Where jobs are sent the sources: this file is sent with them."""
    if IN_BUCKET and IS_MAIN_PROCESS:
        workflow._included[str(path)] = LocalSourceFile(str(path))


def in_bucket(paths):
    """What only a job without a shared file system has as inputs: these results; nothing elsewhere.

    Args:
        paths: a function without arguments that lists them, which costs nothing where it is not called.
    """
    return paths() if IN_BUCKET else []


def refuse_in_a_bucket():
    """Where results lie in a bucket: a sentence for files of the user that a job would not find there."""
    names = in_bucket(lambda: [take.name for take in guided_takes() if take.source == STUDIO])
    if names:
        raise WorkflowError(
            f"guided.takes: found {names[0]}, a take of the studio; expected takes of captures, because corrections "
            "of a studio's take lie among its results, and these are in a bucket. Make it once on a file system "
            "(target `captures`), and name its folder in the take sheet."
        )
