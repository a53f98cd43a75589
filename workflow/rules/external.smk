"""Sequences of other trackers (role `tracked`): read, and made the base of the run (Lips16 4.1).

Reading: takes/{subject}/{take}/tracking/ of the sequence's own row. As the base of the take in its column
`of`: our face model on its topology (face_model/external.npz), the neutral of each subject, and the same
fit.npz and C as our tracker writes, of that take.
"""

from vermilion.config.external_base import weights_path

SEQUENCE_KEYS = (
    "tracking.external.unit_mm",
    "tracking.external.up",
    "tracking.external.mesh",
    "tracking.external.flame",
)


def sequence_source(wildcards):
    """File or folder of a sequence."""
    return take_of(wildcards).source


def sequence_of(take):
    """The row of the sequence that is the base of a take (a row, or wildcards)."""
    return EXTERNAL[take_of(take).name]


def of_sequence(pattern):
    """Input function: `pattern` for every chunk of the base of the wildcards' take, its own row."""
    return lambda wildcards: of_chunks(pattern, sequence_of(wildcards))


def chunk_of_sequence(pattern):
    """Input function: `pattern` for the wildcards' chunk of the base of their take."""
    return lambda wildcards: fill(pattern, sequence_of(wildcards), chunk=wildcards.chunk)


def own_frame(wildcards):
    """What takes a take's results back to its base's own world, unit and polygons (use with `unpack`)."""
    if not EXTERNAL:
        return {}
    return {
        "placement": fill(P.placement, wildcards),
        "origin": fill(P.sequence, sequence_of(wildcards)),
    }


def neutral_take(subject):
    """The take whose neutral is the subject's: its first with an accurate mesh, else its first video."""
    return (takes("tattoo", subject) or takes("video", subject))[0]


def neutral_chunk(take):
    """The chunk of C of a take's base, its own row, that holds the neutral of its subject."""
    row = neutral_take(take.subject)
    name = next(name for name in chunks(row) if neutral_frame(row) in frames_in(name))
    return fill(P.coarse, sequence_of(row), chunk=name)


def space_takes():
    """Takes whose frames the shape coefficients are fitted to: those that train, else all with a base."""
    return takes_that_train() or [_TAKES[name] for name in EXTERNAL]


def sequence_weights(take):
    """The CSV of blend weights of the base of a take; none where the tracker gives none."""
    path = weights_path(CONFIG, sequence_of(take))
    return [path] if path else []


def sequence_place(take):
    """Subject and take of the base of a take, for messages."""
    return {"subject": take.subject, "take": sequence_of(take).take}


def fitted_take(take):
    """What the fit of the shape coefficients is told of a take."""
    return {
        **sequence_place(take),
        "frames": take.train_frames() or list(take.frames),
        "first": take.first,
        "fps": take.fps,
        "neutral": neutral_frame(neutral_take(take.subject)),
        "chunks": len(chunks(take)),
        "weights": "".join(sequence_weights(take)),
    }


def labelled_take():
    """The take on whose neutral our face model is laid: the first that trains."""
    return neutral_take(space_takes()[0].subject)


rule tracked_topology:
    """Writes the triangles of a sequence and what was understood of it: sequence.npz."""
    input:
        source=sequence_source,
        flame=CONFIG.tracking.external.flame or [],
    output:
        topology=P.coarse_topology,
        sequence=P.sequence,
    log:
        P.log("tracked_topology", "take"),
    benchmark:
        P.benchmark("tracked_topology", "take")
    wildcard_constraints:
        take=one_of(take.take for take in takes("tracked")),
    localrule: True
    resources:
        mem_mb=growing(1500),
        runtime=growing(30),
    params:
        cfg=cfg_of(*SEQUENCE_KEYS),
        code=code_of("external/tracked_topology"),
        frames=lambda wildcards: list(take_of(wildcards).frames),
        fps=take_fps,
    script:
        "../scripts/external/tracked_topology.py"


rule tracked_meshes:
    """Reads a chunk of a sequence, in its own world, mm."""
    input:
        source=sequence_source,
        flame=CONFIG.tracking.external.flame or [],
        sequence=P.sequence,
    output:
        meshes=P.coarse,
        quality=P.tracking_quality,
    log:
        P.log("tracked_meshes", "chunk"),
    benchmark:
        P.benchmark("tracked_meshes", "chunk")
    wildcard_constraints:
        take=one_of(take.take for take in takes("tracked")),
    resources:
        mem_mb=growing(1500),
        runtime=growing(30),
    params:
        cfg=cfg_of(*SEQUENCE_KEYS),
        code=code_of("external/tracked_meshes"),
        frames=chunk_frames,
        fps=take_fps,
    script:
        "../scripts/external/tracked_meshes.py"


ruleorder: tracked_meshes > tracking_meshes
ruleorder: tracked_topology > tracking_topology


if EXTERNAL:

    rule external_topology:
        """Lays our face model over the neutral of the first training take, and transfers its labels."""
        input:
            tracker=P.tracker,
            coarse=lambda wildcards: neutral_chunk(labelled_take()),
            topology=lambda wildcards: fill(P.coarse_topology, sequence_of(labelled_take())),
            landmarks=CONFIG.tracking.external.base.landmarks or [],
            detector=lambda wildcards: (
                [] if CONFIG.tracking.external.base.landmarks else detector_files(wildcards)
            ),
        output:
            topology=P.external_topology,
            landmarks=P.external_landmarks,
            overlay=P.external_overlay,
        log:
            P.log("external_topology", "run"),
        benchmark:
            P.benchmark("external_topology", "run")
        resources:
            mem_mb=growing(3000),
            runtime=growing(30),
        params:
            cfg=detector_cfg("face_model.template_slight_open"),
            code=code_of("external/external_topology"),
            model=detector_path,
            take=lambda wildcards: sequence_place(labelled_take()),
            frame=lambda wildcards: neutral_frame(labelled_take()),
        script:
            "../scripts/external/external_topology.py"

    rule external_model:
        """Adds the space of the shape coefficients, fitted to the training frames: external.npz."""
        input:
            topology=P.external_topology,
            coarse=lambda wildcards: [
                path for take in space_takes() for path in of_chunks(P.coarse, sequence_of(take))
            ],
            neutrals=lambda wildcards: [neutral_chunk(take) for take in space_takes()],
            weights=lambda wildcards: [
                path for take in space_takes() for path in sequence_weights(take)
            ],
        output:
            model=P.external_model,
        log:
            P.log("external_model", "run"),
        benchmark:
            P.benchmark("external_model", "run")
        resources:
            mem_mb=growing(4000),
            runtime=growing(30),
        params:
            cfg=cfg_of("tracking.external.base"),
            code=code_of("external/external_model"),
            takes=lambda wildcards: list(map(fitted_take, space_takes())),
        script:
            "../scripts/external/external_model.py"

    rule external_identity:
        """Takes the neutral of a subject on the sequences' topology: subjects/{subject}/identity.npz."""
        input:
            model=base_model,
            coarse=lambda wildcards: neutral_chunk(neutral_take(wildcards.subject)),
        output:
            identity=P.identity,
        log:
            P.log("external_identity", "subject"),
        benchmark:
            P.benchmark("external_identity", "subject")
        localrule: True
        resources:
            mem_mb=growing(1000),
            runtime=growing(10),
        params:
            code=code_of("external/external_identity"),
            take=lambda wildcards: sequence_of(neutral_take(wildcards.subject)).take,
            frame=lambda wildcards: neutral_frame(neutral_take(wildcards.subject)),
        script:
            "../scripts/external/external_identity.py"

    rule external_fit:
        """Finds the sequence's world in the capture's, and the pose of each frame: fit.npz."""
        input:
            tracker=tracker_of,
            identity=P.identity,
            coarse=of_sequence(P.coarse),
            weights=sequence_weights,
            landmarks=per_chunk(P.landmarks),
            cameras=P.cameras,
            calibration=P.calibration,
        output:
            fit=P.fit,
            placement=P.placement,
        log:
            P.log("external_fit", "take"),
        benchmark:
            P.benchmark("external_fit", "take")
        wildcard_constraints:
            take=one_of(_TAKES[name].take for name in EXTERNAL),
        resources:
            mem_mb=growing(1500, for_each_frame=2),
            runtime=growing(30),
        params:
            cfg=cfg_of("tracking.external.base", "tracking.motion.max_reprojection"),
            code=code_of("external/external_fit"),
            fps=take_fps,
            camera=mono_camera,
        script:
            "../scripts/external/external_fit.py"

    rule external_meshes:
        """Writes C of a chunk in the world of the capture, and the mesh over the images."""
        input:
            images=chunk_images,
            tracker=tracker_of,
            identity=P.identity,
            fit=P.fit,
            placement=P.placement,
            coarse=chunk_of_sequence(P.coarse),
            quality=chunk_of_sequence(P.tracking_quality),
            landmarks=P.landmarks,
        output:
            meshes=P.coarse,
            quality=P.tracking_quality,
            overlay=P.tracking_overlay,
        log:
            P.log("external_meshes", "chunk"),
        benchmark:
            P.benchmark("external_meshes", "chunk")
        wildcard_constraints:
            take=one_of(_TAKES[name].take for name in EXTERNAL),
        resources:
            mem_mb=growing(1500, for_mono=350),
            runtime=growing(60),
        params:
            cfg=cfg_of("tracking.meshes"),
            code=code_of("external/external_meshes"),
            source=chunk_source,
            frames=chunk_frames,
        script:
            "../scripts/external/external_meshes.py"

    ruleorder: external_identity > image_identity > identity
    ruleorder: external_fit > tracking
    ruleorder: tracked_meshes > external_meshes > tracking_meshes
