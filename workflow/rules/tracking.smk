"""The coarse sequence C (Lips16 3.2, Mono13 6): the person, then pose and blend weights.

First from landmarks (landmark_fit.npz), then from the images by analysis by synthesis: appearance of
a take (lighting, albedo), pose and expression of each frame, joined over time (fit.npz), offsets
outside the model's space; and how much of the image each step explains.
"""

TRACKED_ROLES = ("tattoo", "video")
#: What every step of the image fit reads, beside its own keys.
IMAGE_FIT_KEYS = ("tracking.fit", "tracking.motion", "tracking.image_fit.lips")


def one_of(names):
    """Regular expression of names (none: matches nothing)."""
    return "|".join(sorted({name.replace(".", r"\.") for name in names})) or "(?!)"


def identity_takes(wildcards):
    """The takes of a subject that landmarks are found in."""
    found = takes(TRACKED_ROLES, wildcards.subject)
    if not found:
        raise WorkflowError(
            f"subject {wildcards.subject}: found no take of role {' or '.join(TRACKED_ROLES)}; "
            f"expected one to track. Add it to {CONFIG.takes}."
        )
    return found


def of_identity_takes(pattern):
    """Input function: `pattern` for every take of a subject, and every chunk where it has them."""
    return lambda wildcards: of_takes(pattern, identity_takes(wildcards))


def sampled_takes(wildcards):
    """What the identity's script is told of each take of a subject."""
    return [
        {
            "take": t.take,
            "camera": mono_camera(t),
            "neutral": t.first if t.is_multiview else None,
            "chunks": len(chunks(t)),
        }
        for t in identity_takes(wildcards)
    ]


def image_identity_subjects():
    """Subjects whose identity images tell of: a model that a scan gave has none to choose from."""
    if not CONFIG.tracking.identity.images.enabled:
        return set()
    return {take.subject for take in takes(TRACKED_ROLES)} - set(CONFIG.tracking.scans)


rule sized_tracker:
    """Gives a subject's face model the size that the distance of their pupils tells: subjects/{subject}/tracker.npz."""
    input:
        tracker=P.tracker,
        landmarks=of_identity_takes(P.landmarks),
        cameras=of_identity_takes(P.cameras),
        calibration=of_identity_takes(P.calibration),
    output:
        tracker=P.own_tracker,
    log:
        P.log("sized_tracker", "subject"),
    benchmark:
        P.benchmark("sized_tracker", "subject")
    wildcard_constraints:
        subject=one_of(MEASURED),
    resources:
        mem_mb=growing(1500),
        runtime=growing(30),
    params:
        cfg=cfg_of("tracking.fit", "tracking.identity"),
        code=code_of("tracking/sized_tracker"),
        takes=sampled_takes,
        eye_distance_mm=lambda wildcards: MEASURED[wildcards.subject],
    script:
        "../scripts/tracking/sized_tracker.py"


ruleorder: sized_tracker > scan


rule identity:
    """Finds the person in landmarks of frames of all takes: subjects/{subject}/identity.npz."""
    input:
        tracker=tracker_of,
        landmarks=of_identity_takes(P.landmarks),
        cameras=of_identity_takes(P.cameras),
        calibration=of_identity_takes(P.calibration),
    output:
        identity=P.identity,
    log:
        P.log("identity", "subject"),
    benchmark:
        P.benchmark("identity", "subject")
    resources:
        mem_mb=growing(1500),
        runtime=growing(30),
    params:
        cfg=cfg_of("tracking.fit", "tracking.identity"),
        code=code_of("tracking/identity"),
        takes=sampled_takes,
    script:
        "../scripts/tracking/identity.py"


rule image_identity:
    """Finds the person in landmarks and images together: subjects/{subject}/identity.npz."""
    input:
        tracker=tracker_of,
        landmarks=of_identity_takes(P.landmarks),
        cameras=of_identity_takes(P.cameras),
        calibration=of_identity_takes(P.calibration),
        images=lambda wildcards: [
            path for take in identity_takes(wildcards) for path in mono_images(take)
        ],
    output:
        identity=P.identity,
        overlay=P.identity_overlay,
    log:
        P.log("image_identity", "subject"),
    benchmark:
        P.benchmark("image_identity", "subject")
    wildcard_constraints:
        subject=one_of(image_identity_subjects()),
    resources:
        mem_mb=growing(1500, for_mono=160),
        runtime=growing(30),
    params:
        cfg=cfg_of("tracking.fit", "tracking.identity"),
        code=code_of("tracking/image_identity"),
        takes=lambda wildcards: [
            row | {"source": mono_source(take)}
            for row, take in zip(sampled_takes(wildcards), identity_takes(wildcards))
        ],
    script:
        "../scripts/tracking/image_identity.py"


ruleorder: image_identity > identity


def landmark_fit():
    """Where the fit to the landmarks lies: beside the fit to the images, or in its place."""
    return P.landmark_fit if CONFIG.tracking.image_fit.enabled else P.fit


def mesh_offsets(wildcards):
    """Input of the meshes: offsets of a chunk that a refinement adds to the model's vertices."""
    return {"offsets": P.offsets} if CONFIG.tracking.offsets.enabled else {}


rule tracking:
    """Fits pose and blend weights of a whole take to its landmarks."""
    input:
        tracker=tracker_of,
        identity=P.identity,
        landmarks=per_chunk(P.landmarks),
        cameras=P.cameras,
        video=facts_of_video,
    output:
        fit=landmark_fit(),
    log:
        P.log("tracking", "take"),
    benchmark:
        P.benchmark("tracking", "take")
    resources:
        mem_mb=growing(1000, for_each_frame=2),
        runtime=growing(60),
    params:
        cfg=cfg_of("tracking.fit", "tracking.motion"),
        code=code_of("tracking/tracking"),
        camera=mono_camera,
        fps=take_fps,
    script:
        "../scripts/tracking/tracking.py"


def image_steps():
    """Steps whose residuals are measured, in order: names of folders under tracking/residuals/."""
    options = CONFIG.tracking
    switches = {"image_fit": options.image_fit.enabled, "offsets": options.offsets.enabled}
    steps = [name for name, on in switches.items() if on]
    return ["landmarks", *steps] if steps else []


def ablation_tables(wildcards=None):
    """Residuals of every step, chunk and take that is used, and of the finer sequences."""
    return detail_residuals() + residuals_of(used_takes(TRACKED_ROLES), image_steps())


def residuals_of(rows, steps):
    """Tables of residuals of some takes, every chunk after every step."""
    return [
        path
        for take in rows
        for step in steps
        for path in of_chunks(P.residuals.replace("{step}", step), take)
    ]


rule appearance:
    """Estimates the lighting and the albedo of a take: tracking/appearance.npz."""
    input:
        images=mono_images,
        tracker=tracker_of,
        identity=P.identity,
        fit=landmark_fit(),
        landmarks=per_chunk(P.landmarks),
    output:
        appearance=P.appearance,
        overlay=P.appearance_overlay,
    log:
        P.log("appearance", "take"),
    benchmark:
        P.benchmark("appearance", "take")
    resources:
        mem_mb=growing(1500, for_mono=300),
        runtime=growing(30),
    params:
        cfg=cfg_of(
            *IMAGE_FIT_KEYS,
            "tracking.image_fit.appearance",
            "tracking.image_fit.frame_fit",
        ),
        code=code_of("tracking/appearance"),
        source=mono_source,
    script:
        "../scripts/tracking/appearance.py"


rule image_fit:
    """Fits pose and expression of each frame of a chunk to its image: tracking/image_fit/{chunk}.npz."""
    input:
        images=chunk_images,
        tracker=tracker_of,
        identity=P.identity,
        fit=landmark_fit(),
        appearance=P.appearance,
        landmarks=P.landmarks,
    output:
        P.image_fit,
    log:
        P.log("image_fit", "chunk"),
    benchmark:
        P.benchmark("image_fit", "chunk")
    resources:
        mem_mb=growing(1500, for_mono=30),
        runtime=growing(60),
    params:
        cfg=cfg_of(
            *IMAGE_FIT_KEYS,
            "tracking.image_fit.appearance",
            "tracking.image_fit.frame_fit",
        ),
        code=code_of("tracking/image_fit"),
        source=chunk_source,
        frames=chunk_frames,
    script:
        "../scripts/tracking/image_fit.py"


if CONFIG.tracking.image_fit.enabled:

    rule image_fit_join:
        """Joins the fitted frames of a take, smooth over time: tracking/fit.npz."""
        input:
            tracker=tracker_of,
            identity=P.identity,
            fit=landmark_fit(),
            chunks=per_chunk(P.image_fit),
            landmarks=per_chunk(P.landmarks),
            video=facts_of_video,
        output:
            fit=P.fit,
        log:
            P.log("image_fit_join", "take"),
        benchmark:
            P.benchmark("image_fit_join", "take")
        resources:
            mem_mb=growing(1000, for_each_frame=2),
            runtime=growing(60),
        params:
            cfg=cfg_of(*IMAGE_FIT_KEYS, "tracking.image_fit.join"),
            code=code_of("tracking/image_fit_join"),
            fps=take_fps,
        script:
            "../scripts/tracking/image_fit_join.py"


rule offsets:
    """Offsets of the vertices outside the model's space: tracking/offsets/{chunk}.npy."""
    input:
        images=chunk_images,
        tracker=tracker_of,
        identity=P.identity,
        fit=P.fit,
        appearance=P.appearance,
        landmarks=P.landmarks,
    output:
        P.offsets,
    log:
        P.log("offsets", "chunk"),
    benchmark:
        P.benchmark("offsets", "chunk")
    resources:
        mem_mb=growing(1500),
        runtime=growing(60),
    params:
        cfg=cfg_of(*IMAGE_FIT_KEYS, "tracking.image_fit.appearance", "tracking.offsets"),
        code=code_of("tracking/offsets"),
        source=chunk_source,
        frames=chunk_frames,
    script:
        "../scripts/tracking/offsets.py"


rule residuals:
    """How much of the images of a chunk each step leaves unexplained: residuals/<step>/."""
    input:
        unpack(mesh_offsets),
        images=chunk_images,
        tracker=tracker_of,
        identity=P.identity,
        landmark_fit=landmark_fit(),
        fit=P.fit,
        appearance=P.appearance,
        landmarks=P.landmarks,
    output:
        tables=[P.residuals.replace("{step}", step) for step in image_steps() or ["landmarks"]],
        overlay=P.residuals_overlay,
    log:
        P.log("residuals", "chunk"),
    benchmark:
        P.benchmark("residuals", "chunk")
    resources:
        mem_mb=growing(1500, for_mono=110),
        runtime=growing(60),
    params:
        cfg=cfg_of(
            *IMAGE_FIT_KEYS,
            "tracking.image_fit.appearance",
            "tracking.image_fit.overlay_frames",
        ),
        code=code_of("tracking/residuals"),
        source=chunk_source,
        frames=chunk_frames,
        steps=image_steps() or ["landmarks"],
    script:
        "../scripts/tracking/residuals.py"


rule ablations:
    """Joins the residuals of all takes, a row a take and step: evaluation/ablations.tsv."""
    input:
        tables=ablation_tables,
    output:
        table=in_report(P.ablations, "Tables", "ablations", table="refinements of the track"),
    log:
        P.log("ablations", "run"),
    benchmark:
        P.benchmark("ablations", "run")
    localrule: True
    resources:
        mem_mb=growing(800),
        runtime=growing(10),
    params:
        code=code_of("tracking/ablations"),
    script:
        "../scripts/tracking/ablations.py"


rule tracking_meshes:
    """Writes C of a chunk in the world, and the model over the images: tracking/C/{chunk}.npy."""
    input:
        unpack(mesh_offsets),
        images=chunk_images,
        tracker=tracker_of,
        identity=P.identity,
        fit=P.fit,
        landmarks=P.landmarks,
    output:
        meshes=P.coarse,
        quality=P.tracking_quality,
        overlay=P.tracking_overlay,
    log:
        P.log("tracking_meshes", "chunk"),
    benchmark:
        P.benchmark("tracking_meshes", "chunk")
    resources:
        mem_mb=growing(1500, for_mono=350),
        runtime=growing(60),
    params:
        cfg=cfg_of("tracking.meshes"),
        code=code_of("tracking/tracking_meshes"),
        source=chunk_source,
        frames=chunk_frames,
    script:
        "../scripts/tracking/tracking_meshes.py"


rule tracking_topology:
    """Writes the triangles of C beside its chunks: tracking/C/topology.ply."""
    input:
        tracker=tracker_of,
        identity=P.identity,
    output:
        P.coarse_topology,
    log:
        P.log("tracking_topology", "take"),
    benchmark:
        P.benchmark("tracking_topology", "take")
    localrule: True
    resources:
        mem_mb=growing(800),
        runtime=growing(10),
    params:
        code=code_of("tracking/tracking_topology"),
    script:
        "../scripts/tracking/tracking_topology.py"
