"""What a run begins with is what all its jobs use: the configuration, the take sheet, the code."""

from snakemake.settings.types import ExecMode

from vermilion.provenance import begun_run

IS_MAIN_PROCESS = workflow.exec_mode == ExecMode.DEFAULT
HERE = Path(workflow.current_basedir.get_path_or_uri(secret_free=True))
RULE_FILES = list(HERE.glob("*.smk"))
#: Taken before any code is looked at: what changes from now on is not what the run begins with.
STAMP = begun_run.stamp_of(HERE.parent / "scripts") if IS_MAIN_PROCESS else ""
#: Script -> its file, of every rule.
SCRIPT_FILES = {}
#: The beginning of the run that this process is a job of.
BEGUN = None if IS_MAIN_PROCESS else begun_run.of_this_job()

if BEGUN and BEGUN.rules != begun_run.digest_of(RULE_FILES):
    raise WorkflowError(
        "The rule files changed after this run had begun: the job was not started. "
        "Run the same command again."
    )
config = begun_run.with_beginning(config, BEGUN)


def record_beginning():
    """Write down for the jobs of this run what it begins with."""
    needed = {Path(str(job.rule.script)).resolve() for job in workflow.dag.needrun_jobs()}
    code = {
        script: fingerprint(path)
        for script, path in SCRIPT_FILES.items()
        if path.resolve() in needed
    }
    begun = begun_run.BegunRun(
        configuration=config,
        takes=CONFIG.takes,
        rules=begun_run.digest_of(RULE_FILES),
        code=code,
        stamp=STAMP,
    )
    begun_run.record_beginning(Path(".snakemake/vermilion"), begun)


def link_to_local_copies(results):
    """Where results lie in a bucket: their name leads to the local copies of what the job reads and writes.

    Snakemake gives scripts the paths of the copies; folders that stand in parameters are found by this.
    """
    settings = workflow.storage_settings
    if not settings.default_storage_provider:
        return
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


def refuse_stages_in_a_bucket():
    """Where results lie in a bucket: a sentence for stages that would not find all that they read."""
    if not workflow.storage_settings.default_storage_provider:
        return
    names = sorted({job.rule.name for job in workflow.dag.needrun_jobs()})
    whole = ("face_model", "studio_", "video_facts", "capture", "all", "captures")
    wrong = [name for name in names if not name.startswith(whole)]
    if wrong:
        raise WorkflowError(
            f"rule {wrong[0]} opens files that the graph does not name, which a job without a shared file system "
            f"would not find ({len(wrong)} such rules). Only captures and their manifests can be made in a bucket; "
            "for the rest mount it, or another file system, in all jobs: docs/howto/cluster.md."
        )
