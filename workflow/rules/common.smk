"""What all stages share: the checked configuration, takes and chunks, parameters, fingerprints."""

import os
import sys
from pathlib import Path

# A job uses the cores that Snakemake gives it; the libraries under it start no threads of their own.
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

from snakemake.exceptions import WorkflowError
from snakemake.settings.types import ExecMode

from vermilion.config.load import load_configuration
from vermilion.config.takes import STUDIO, Take
from vermilion.storage.errors import ConfigurationError
from vermilion.config.regressors import (
    regressors_of,
    regressors_of_study,
    trained_on,
    with_variants,
)
from vermilion.provenance import checksums
from vermilion.provenance.cache import roles_of, wildcards_of
from vermilion.provenance.fingerprint import fingerprint

IS_MAIN_PROCESS = workflow.exec_mode == ExecMode.DEFAULT
ORIGIN = ", ".join(str(path) for path in workflow.configfiles)

try:
    CONFIG, TAKES = load_configuration(config, ORIGIN, check_disk=IS_MAIN_PROCESS)
except ConfigurationError as error:
    raise WorkflowError(str(error)) from None

R = CONFIG.results
SCRIPTS = Path(workflow.basedir) / "workflow" / "scripts"
_TAKES = {take.name: take for take in TAKES}


wildcard_constraints:
    subject=r"[A-Za-z0-9_.]+",
    take=r"[A-Za-z0-9_.]+",
    chunk=r"\d{6}-\d{6}",
    regressor=r"[A-Za-z0-9_.\-]+",


def cfg_of(*keys):
    """Exactly these keys (dotted paths) of the configuration, as one dict of plain values.

    A rule passes it as `params: cfg=...`: Snakemake compares parameters as a set, so that values in
    separate parameters could be swapped unseen.
    """
    return {key: plain_value(key) for key in keys}


def plain_value(key):
    """The value of a dotted key, as JSON has it."""
    value = CONFIG.model_dump(mode="json")
    for part in key.split("."):
        value = value[part]
    return value


def code_of(script):
    """Fingerprint of `workflow/scripts/<script>.py` and of all that it imports from the library."""
    return lambda wildcards: fingerprint(SCRIPTS / f"{script}.py")


def takes(role=None, subject=None):
    """Rows of the take sheet of one or several roles and of a subject, in the sheet's order."""
    roles = (role,) if isinstance(role, str) else role
    return [
        take
        for take in TAKES
        if (roles is None or take.role in roles) and (subject is None or take.subject == subject)
    ]


def subjects(role=None):
    """Names of the subjects that have a take of a role, in the sheet's order."""
    return list(dict.fromkeys(take.subject for take in takes(role)))


def take_of(wildcards):
    """The row of the wildcards' take."""
    name = f"{wildcards.subject}/{wildcards.take}"
    if name not in _TAKES:
        raise WorkflowError(
            f"take {name}: found no such row; expected one of {', '.join(_TAKES)}. "
            f"Add it to {CONFIG.takes}."
        )
    return _TAKES[name]


def chunks(subject, take):
    """Names `<first>-<last>` of the chunks of a take."""
    row = _TAKES[f"{subject}/{take}"]
    size = CONFIG.chunk_frames
    starts = range(row.first, row.last + 1, size)
    return [f"{a:06d}-{min(a + size - 1, row.last):06d}" for a in starts]


def frames_in(chunk):
    """Frame numbers of a chunk."""
    first, last = (int(number) for number in chunk.split("-"))
    return list(range(first, last + 1))


def per_chunk(pattern):
    """Input function: `pattern` for every chunk of the wildcards' take."""
    return lambda wildcards: expand_chunks(pattern, wildcards.subject, wildcards.take)


def first_chunk(pattern):
    """Input function: `pattern` for the chunk of the wildcards' take that holds the neutral."""
    return lambda wildcards: expand_chunks(pattern, wildcards.subject, wildcards.take)[0]


def expand_chunks(pattern, subject, take):
    """`pattern` for every chunk of a take; other wildcards of the pattern are kept."""
    return [
        pattern.replace("{subject}", subject).replace("{take}", take).replace("{chunk}", chunk)
        for chunk in chunks(subject, take)
    ]


def source_of(wildcards):
    """Where the images of a take lie: what the sheet says, or the studio's capture folder."""
    take = take_of(wildcards)
    if take.source == STUDIO:
        return f"{R}/captures/{take.subject}/{take.take}"
    return take.source


def mono_inputs(wildcards):
    """Inputs of a job that reads the monocular images of a chunk (use with `unpack`)."""
    folder = f"{R}/takes/{wildcards.subject}/{wildcards.take}"
    inputs = {"manifest": f"{folder}/capture/{wildcards.chunk}.json"}
    if take_of(wildcards).role == "tattoo":
        inputs["inpainted"] = f"{folder}/inpaint/{wildcards.chunk}"
    return inputs


def mono_source(wildcards):
    """What `open_frames` opens for the monocular images: inpainted frames of a tattoo take."""
    if take_of(wildcards).role == "tattoo":
        return f"{R}/takes/{wildcards.subject}/{wildcards.take}/inpaint/{wildcards.chunk}"
    return source_of(wildcards)


def tracker_of(wildcards):
    """The tracker's face model for a subject: their own, made from a scan, or everybody's."""
    if wildcards.subject in CONFIG.tracking.scans:
        return f"{R}/subjects/{wildcards.subject}/tracker.npz"
    return f"{R}/face/tracker.npz"


def mono_images(wildcards):
    """Checked manifests of all chunks of a take, and its inpainted frames if it has a tattoo."""
    folder = R + "/takes/{subject}/{take}"
    name = (wildcards.subject, wildcards.take)
    inputs = expand_chunks(folder + "/capture/{chunk}.json", *name)
    if take_of(wildcards).role == "tattoo":
        inputs += expand_chunks(folder + "/inpaint/{chunk}", *name)
    return inputs


def mono_sources(wildcards):
    """What `open_frames` opens for the monocular images of a whole take."""
    if take_of(wildcards).role == "tattoo":
        pattern = R + "/takes/{subject}/{take}/inpaint/{chunk}"
        return expand_chunks(pattern, wildcards.subject, wildcards.take)
    return source_of(wildcards)


def mono_camera(wildcards):
    """Name of the monocular camera: the frontal one of a rig, the only one of a video."""
    take = take_of(wildcards)
    if take.is_multiview:
        return CONFIG.capture.frontal_camera
    if take.source == STUDIO:
        return "cam"
    folders = sorted(Path(take.source).glob("frames/*/"))
    return folders[0].name if folders else "cam"


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
    refused = checksums.record(Path(R), jobs, ends.get)
    for damage in refused:
        print(f"not to be trusted: {damage.path}: {damage.reason}", file=sys.stderr)
