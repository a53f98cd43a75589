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
