"""User-guided lip correction (Guided18): a person corrects a few frames, and the take follows.

Off unless `guided.takes` names takes. Sketches and sculpts are input files of the capture:
`labels/sketches/<camera>/<frame>.json`, `labels/sculpts/<frame>.obj`, `.ply` or `.usd`. In the order of the
paper: `guided_suggest` (7), `guided_refine` (5), `guided_train` and `guided_correct` (4), then the files
that `apply` exports, all in takes/<subject>/<take>/guided/.
"""

from vermilion.guided.sculpt_files import SCULPT_SUFFIXES as SCULPTS
from vermilion.imaging.source import folder_of

#: Sequence that is corrected -> its chunks.
SEQUENCES = {"base": P.coarse, "corrected": P.corrected, "H": P.accurate}


def guided_takes():
    """Rows of the takes to correct, in the order of the configuration."""
    return [_TAKES[name] for name in CONFIG.guided.takes]


def person_corrections(wildcards):
    """Frame -> [its sculpt], or its sketches, of the wildcards' take; a sculpt goes before sketches."""
    take = take_of(wildcards)
    source = fill(P.capture_folder, take) if take.source == STUDIO else take.source
    labels, found = folder_of(source, "labels"), {}
    for path in sorted(labels.glob("sketches/*/*.json")):
        found.setdefault(path.stem, []).append(str(path))
    for path in sorted(p for p in labels.glob("sculpts/*") if p.suffix.lower() in SCULPTS):
        found[path.stem] = [str(path)]
    frames = {f"{frame:06d}" for frame in take.frames}
    return {frame: found[frame] for frame in sorted(found) if frame in frames}


def sketched_takes():
    """Rows of the takes that have a corrected frame."""
    return [take for take in guided_takes() if person_corrections(take)]


def of_frames(pattern, rows):
    """`pattern` for each corrected frame of some takes."""
    return [fill(pattern, take, frame=frame) for take in rows for frame in person_corrections(take)]


def guided_outputs():
    """Suggestions of every take; where frames are corrected, these, and the whole take."""
    return [
        *of_takes(P.suggestions, guided_takes()),
        *of_frames(P.refined, guided_takes()),
        *of_takes(P.guided_chunk, sketched_takes()),
        *of_takes(P.guided_overlay, sketched_takes()),
    ]


def sequence_name(wildcards):
    """Which sequence of the wildcards' take is corrected."""
    return CONFIG.guided.takes[take_of(wildcards).name]


def guided_chunks(wildcards):
    """All chunks of that sequence."""
    return of_chunks(SEQUENCES[sequence_name(wildcards)], wildcards)


def guided_chunk(wildcards):
    """The chunk of that sequence that is the wildcards' or holds their frame."""
    return fill(SEQUENCES[sequence_name(wildcards)], wildcards, chunk=chunk_of(wildcards))


def chunk_of(wildcards):
    """The wildcards' chunk, or the one that holds their frame."""
    if "chunk" in wildcards.keys():
        return wildcards.chunk
    return next(name for name in chunks(wildcards) if int(wildcards.frame) in frames_in(name))


def guided_face(wildcards):
    """The face model whose topology the sequence has."""
    return P.template if sequence_name(wildcards) == "H" else tracker_of(wildcards)


def guided_neutral(wildcards):
    """The person's neutral in that topology (use with `unpack`)."""
    if sequence_name(wildcards) == "H":
        return {"neutral": P.neutral.format(**wildcards)}
    return {"identity": P.identity.format(subject=wildcards.subject)}


def guided_frame(wildcards):
    """What takes the sequence back to another tracker's own world; nothing for H (use with `unpack`)."""
    return {} if sequence_name(wildcards) == "H" else own_frame(wildcards)


def guided_exports_need(wildcards):
    """What the exported files need beyond the corrected chunks (use with `unpack`)."""
    needed = exports_need(wildcards)
    return {k: v for k, v in needed.items() if k not in own_frame(wildcards)} | guided_frame(
        wildcards
    )


rule guided_suggest:
    """The frames that are worth correcting next: guided/suggestions.tsv (Guided18 7)."""
    input:
        unpack(guided_neutral),
        face=guided_face,
        fit=P.fit,
        sequence=guided_chunks,
    output:
        table=P.suggestions,
    log:
        P.log("guided_suggest", "take"),
    benchmark:
        P.benchmark("guided_suggest", "take")
    resources:
        mem_mb=growing(2000),
        runtime=growing(30),
    params:
        cfg=cfg_of("guided.regions", "guided.suggestion"),
        code=code_of("guided/guided_suggest"),
        corrected=lambda wildcards: [int(frame) for frame in person_corrections(wildcards)],
    script:
        "../scripts/guided/guided_suggest.py"


rule guided_refine:
    """Moves one frame onto its sketches: guided/refined/{frame}.npz (Guided18 5, eq. 1)."""
    input:
        unpack(guided_frame),
        corrections=lambda wildcards: person_corrections(wildcards)[wildcards.frame],
        images=lambda wildcards: images_of(wildcards, [chunk_of(wildcards)], [int(wildcards.frame)]),
        face=guided_face,
        sequence=guided_chunk,
        cameras=P.cameras,
        fit=P.fit,
    output:
        refined=P.refined,
        quality=P.refined_quality,
        overlay=P.refined_overlay,
    log:
        P.log("guided_refine", "frame"),
    benchmark:
        P.benchmark("guided_refine", "frame")
    resources:
        mem_mb=growing(1500),
        runtime=growing(10),
    params:
        cfg=cfg_of("guided.regions", "guided.refinement", "guided.contact"),
        code=code_of("guided/guided_refine"),
        source=source_of,
        kind=lambda wildcards, input: (
            "sculpt" if input.corrections[0].lower().endswith(SCULPTS) else "sketch"
        ),
        tracked=lambda wildcards: sequence_name(wildcards) != "H",
    script:
        "../scripts/guided/guided_refine.py"


rule guided_train:
    """Learns inner lips from the corrected frames: guided/propagator.npz (Guided18 4)."""
    input:
        unpack(guided_neutral),
        face=guided_face,
        refined=lambda wildcards: of_frames(P.refined, [take_of(wildcards)]),
    output:
        model=P.lip_propagator,
    log:
        P.log("guided_train", "take"),
    benchmark:
        P.benchmark("guided_train", "take")
    resources:
        mem_mb=growing(2000),
        runtime=growing(20),
    params:
        cfg=cfg_of(
            "guided.regions",
            "guided.propagation.predict",
            "guided.propagation.with_neutral",
            "guided.propagation.follow_mm",
        ),
        code=code_of("guided/guided_train"),
    script:
        "../scripts/guided/guided_train.py"


rule guided_correct:
    """Corrects a chunk of the sequence: guided/chunks/{chunk}.npy (Guided18 4)."""
    input:
        images=chunk_images,
        face=guided_face,
        tracker=tracker_of,
        identity=P.identity,
        fit=P.fit,
        sequence=guided_chunk,
        model=P.lip_propagator,
    output:
        corrected=P.guided_chunk,
        video=P.guided_clip,
        quality=P.guided_quality,
        overlay=P.guided_chunk_overlay,
    log:
        P.log("guided_correct", "chunk"),
    benchmark:
        P.benchmark("guided_correct", "chunk")
    resources:
        mem_mb=growing(1500),
        runtime=growing(60),
    params:
        cfg=cfg_of("apply.overlay", "guided.contact", "guided.propagation.novelty_limit"),
        code=code_of("guided/guided_correct"),
        frames=chunk_frames,
        fps=take_fps,
        source=chunk_source,
        camera=mono_camera,
        sequence=sequence_name,
    script:
        "../scripts/guided/guided_correct.py"


rule guided_export:
    """Joins the chunks of a take into the files that `apply` exports, in guided/."""
    input:
        unpack(guided_exports_need),
        tracker=guided_face,
        fit=P.fit,
        corrected=per_chunk(P.guided_chunk),
        overlays=per_chunk(P.guided_clip),
        quality=per_chunk(P.guided_quality),
    output:
        **exports_to(P.guided, P.guided_overlay, P.guided_timeline, "Guided takes"),
    log:
        P.log("guided_export", "take"),
    benchmark:
        P.benchmark("guided_export", "take")
    resources:
        mem_mb=growing(2000),
        runtime=growing(30),
    params:
        cfg=cfg_of("apply.export"),
        code=code_of("apply/apply_export"),
        fps=take_fps,
        neutral=rest_frame,
        source=mono_source,
    script:
        "../scripts/apply/apply_export.py"
