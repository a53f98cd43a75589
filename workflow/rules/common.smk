"""What all stages share: the checked configuration, takes and chunks, parameters, fingerprints."""

import gc
import os
import sys
from pathlib import Path

# The graph of jobs lives as long as the run: to look through it for garbage at every 700 new objects
# costs a tenth of the start.
gc.freeze()
gc.set_threshold(50_000)

# A job uses the cores that Snakemake gives it; the libraries under it start no threads of their own.
for variable in (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "OPENCV_FOR_THREADS_NUM",
):
    os.environ.setdefault(variable, "1")

from snakemake.exceptions import WorkflowError

from vermilion.config.external_base import sequences_of
from vermilion.config.load import load_configuration, read_keys
from vermilion.config.skip import without_skipped
from vermilion.config.takes import STUDIO, Take, eye_distances
from vermilion.storage.errors import VermilionError
from vermilion.config.regressors import (
    GENERIC,
    regressors_of,
    regressors_of_study,
    trained_on,
    with_variants,
)
from vermilion.provenance.cache import roles_of, wildcards_of
from vermilion.provenance.fingerprint import fingerprint

if any(letter.isspace() for letter in sys.executable):
    raise WorkflowError(
        f"Snakemake cannot start jobs with {sys.executable}: the path has a blank. "
        "Start the workflow by `make run` or `vermilion run`, which go around it."
    )


include: "beginning.smk"


ORIGIN = ", ".join(str(path) for path in workflow.configfiles)

try:
    if IS_MAIN_PROCESS:  # Snakemake reads them, but takes the last of two equal keys
        _ = [read_keys(path) for path in workflow.configfiles]
    CONFIG, TAKES = load_configuration(config, ORIGIN, check_disk=IS_MAIN_PROCESS)
except VermilionError as error:
    raise WorkflowError(str(error)) from None
SKIPPED = [take for take in TAKES if take.name in CONFIG.skip_takes]
CONFIG, TAKES = without_skipped(CONFIG, TAKES)


include: "paths.smk"
include: "resources.smk"
include: "bucket.smk"


link_to_local_copies(R)
prepare_bucket(R)
send_with_sources(CONFIG.takes)
_TAKES = {take.name: take for take in TAKES}
#: Name of a take -> the row of another tracker's sequence that is its base; empty: our own tracker's is.
EXTERNAL = sequences_of(TAKES)
#: Subject -> measured distance of the pupils (mm).
MEASURED = eye_distances(TAKES)


wildcard_constraints:
    subject=r"[A-Za-z0-9_.]+",
    take=r"[A-Za-z0-9_.]+",
    chunk=r"\d{6}-\d{6}",
    frame=r"\d{6}",
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


def in_report(path, category, caption, subcategory=None, **labels):
    """An output that Snakemake's report shows, with the text of `workflow/report/<caption>.rst`."""
    return report(
        path,
        category=category,
        subcategory=subcategory,
        labels=labels,
        caption=f"../report/{caption}.rst",
    )


def code_of(script):
    """Fingerprint of `workflow/scripts/<script>.py` and of all that it imports from the library."""
    # Beside this file, also where another workflow takes this one in as a module.
    path = SCRIPT_FILES[script] = Path(workflow.source_path(f"../scripts/{script}.py"))
    known = BEGUN.code.get(script) if BEGUN else None
    return lambda wildcards: known or fingerprint(path)


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


def chunks(take):
    """Names `<first>-<last>` of the chunks of a take (a row, or wildcards)."""
    row = take_of(take)
    size = CONFIG.chunk_frames
    starts = range(row.first, row.last + 1, size)
    return [f"{a:06d}-{min(a + size - 1, row.last):06d}" for a in starts]


def ends_of(chunk):
    """First and last frame number of a chunk."""
    first, last = chunk.split("-")
    return int(first), int(last)


def frames_in(chunk):
    """Frame numbers of a chunk."""
    first, last = ends_of(chunk)
    return list(range(first, last + 1))


def fill(pattern, take, **values):
    """A pattern of `P` for a take (a row, or wildcards) and other wildcards; the rest are kept."""
    for name, value in {"subject": take.subject, "take": take.take, **values}.items():
        pattern = pattern.replace(f"{{{name}}}", value)
    return pattern


def of_chunks(pattern, take):
    """`pattern` for every chunk of a take (a row, or wildcards)."""
    return [fill(pattern, take, chunk=chunk) for chunk in chunks(take)]


def of_takes(pattern, rows):
    """`pattern` for each of some takes, and for each of their chunks where it has them."""
    paths = [path for take in rows for path in of_chunks(pattern, take)]
    return list(dict.fromkeys(paths))


def per_chunk(pattern):
    """Input function: `pattern` for every chunk of the wildcards' take."""
    return lambda wildcards: of_chunks(pattern, wildcards)


def first_chunk(pattern):
    """Input function: `pattern` for the chunk of the wildcards' take that holds the neutral."""
    return lambda wildcards: of_chunks(pattern, wildcards)[0]


def near_chunks(wildcards, reach):
    """Chunks of the wildcards' take with a frame at most `reach` frames from the wildcards' chunk."""
    first, last = ends_of(wildcards.chunk)
    return [
        chunk
        for chunk in chunks(wildcards)
        if ends_of(chunk)[0] <= last + reach and ends_of(chunk)[1] >= first - reach
    ]


def source_of(wildcards):
    """Where the images of a take lie: what the sheet says, or the studio's capture folder.

    A plain path, or one with how its image files are read where the configuration says that.
    """
    take, capture = take_of(wildcards), CONFIG.capture
    if take.source == STUDIO:
        return fill(P.capture_folder, take)
    if not (capture.exr_layer or capture.colour_space):
        return take.source
    reading = {"exr_layer": capture.exr_layer, "colour_space": capture.colour_space}
    return {"path": take.source, **reading}


def images_of(wildcards, names, frames=None):
    """What a job waits for that opens captured images of a take: the manifests of some of its chunks.

    In a bucket also the studio's images, as nothing else brings them to the job.

    Args:
        wildcards: of the take, or its row.
        names: the chunks.
        frames: those that it opens; None: all of the chunks.
    """
    return [fill(P.manifest, wildcards, chunk=name) for name in names] + in_bucket(
        lambda: studio_images(
            wildcards, frames or [frame for name in names for frame in frames_in(name)]
        )
    )


def captured_take(wildcards):
    """Inputs of a job that opens captured images of a whole take."""
    return images_of(wildcards, chunks(wildcards))


def captured_chunk(wildcards):
    """Inputs of a job that opens captured images of a chunk."""
    return images_of(wildcards, [wildcards.chunk])


def captured_neutral(wildcards):
    """Inputs of a job that opens captured images of a take's first frame: the neutral."""
    return images_of(wildcards, chunks(wildcards)[:1], [first_frame(wildcards)])


def mono_images(wildcards):
    """Inputs of a job that opens the monocular images of a whole take: inpainted ones of a tattoo."""
    if take_of(wildcards).role == "tattoo":
        return of_chunks(P.manifest, wildcards) + of_chunks(P.inpainted, wildcards)
    return captured_take(wildcards)


def chunk_images(wildcards):
    """Inputs of a job that opens the monocular images of a chunk."""
    if take_of(wildcards).role == "tattoo":
        return [fill(part, wildcards, chunk=wildcards.chunk) for part in (P.manifest, P.inpainted)]
    return captured_chunk(wildcards)


def mono_source(wildcards):
    """What `open_frames` opens for the monocular images of a whole take."""
    if take_of(wildcards).role == "tattoo":
        return of_chunks(P.inpainted, wildcards)
    return source_of(wildcards)


def chunk_source(wildcards):
    """What `open_frames` opens for the monocular images of a chunk."""
    if take_of(wildcards).role == "tattoo":
        return fill(P.inpainted, wildcards, chunk=wildcards.chunk)
    return source_of(wildcards)


def chunk_frames(wildcards):
    """Frame numbers of the wildcards' chunk."""
    return frames_in(wildcards.chunk)


def first_frame(wildcards):
    """Number of the take's first frame: the neutral."""
    return take_of(wildcards).first


def take_span(wildcards):
    """First and last frame of the wildcards' take."""
    return [take_of(wildcards).first, take_of(wildcards).last]


def take_fps(wildcards):
    """Frames a second of the wildcards' take."""
    return take_of(wildcards).fps


def base_model(wildcards=None):
    """Everybody's face model of the base's topology: the tracker's, or another tracker's."""
    if EXTERNAL:
        return CONFIG.tracking.external.base.model or P.external_model
    return P.tracker


def tracker_of(wildcards):
    """The base's face model for a subject: their own, of a scan or of their size, or everybody's."""
    own = wildcards.subject in CONFIG.tracking.scans or wildcards.subject in MEASURED
    if own and not EXTERNAL:
        return P.own_tracker.format(subject=wildcards.subject)
    return base_model()


def mono_camera(wildcards):
    """Name of the monocular camera: the frontal one of a rig, the only one of a video."""
    take = take_of(wildcards)
    if take.is_multiview:
        return CONFIG.capture.frontal_camera
    if take.source == STUDIO:
        return "cam"
    folders = sorted(Path(take.source).glob("frames/*/"))
    return folders[0].name if folders else "cam"
