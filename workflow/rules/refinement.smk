"""Dense refinement of the track by its images: analysis by synthesis (Lips16 3.2).

Appearance of a take (lighting, albedo), then pose and expression of each frame, joined over time to
tracking/fit.npz, then the corrective layer; and how much of the image each step explains.
"""

TRACKING = R + "/takes/{subject}/{take}/tracking"


def refinement_steps():
    """Steps whose residuals are measured, in order: names of folders under tracking/residuals/."""
    switches = {"photometric": CONFIG.refinement.photometric, "layer": CONFIG.refinement.layer}
    steps = [name for name, on in switches.items() if on]
    return ["landmarks", *steps] if steps else []


def take_images(wildcards):
    """Inputs of a job that reads monocular images of a whole take (use with `unpack`)."""
    folder = R + "/takes/{subject}/{take}"
    inputs = {"manifests": per_chunk(folder + "/capture/{chunk}.json")(wildcards)}
    if take_of(wildcards).role == "tattoo":
        inputs["inpainted"] = per_chunk(folder + "/inpaint/{chunk}")(wildcards)
    return inputs


def take_source(wildcards):
    """What `open_frames` opens for the monocular images of a whole take."""
    return take_images(wildcards).get("inpainted") or source_of(wildcards)


def ablation_tables(wildcards=None):
    """Residuals of every step, chunk and take that is used, and of the finer sequences."""
    return detail_residuals() + [
        path
        for take in used_takes(("tattoo", "video"))
        for step in refinement_steps()
        for path in expand_chunks(
            TRACKING + f"/residuals/{step}/{{chunk}}.tsv", take.subject, take.take
        )
    ]


rule appearance:
    """Estimates the lighting and the albedo of a take: tracking/appearance.npz."""
    input:
        unpack(take_images),
        tracker=tracker_of,
        identity=R + "/subjects/{subject}/identity.npz",
        fit=landmark_fit(),
        landmarks=per_chunk(R + "/takes/{subject}/{take}/landmarks/{chunk}.npz"),
    output:
        appearance=TRACKING + "/appearance.npz",
        overlay=TRACKING + "/appearance.png",
    log:
        R + "/logs/appearance/{subject}-{take}.log",
    benchmark:
        R + "/benchmarks/appearance/{subject}-{take}.tsv"
    resources:
        mem_mb=1500,
        runtime=30,
    params:
        cfg=cfg_of("tracking.fit", "tracking.motion", "refinement.appearance", "refinement.fit"),
        code=code_of("tracking/appearance"),
        source=take_source,
    script:
        "../scripts/tracking/appearance.py"


rule photometric:
    """Refines pose and expression of each frame of a chunk: tracking/photometric/{chunk}.npz."""
    input:
        unpack(mono_inputs),
        tracker=tracker_of,
        identity=R + "/subjects/{subject}/identity.npz",
        fit=landmark_fit(),
        appearance=TRACKING + "/appearance.npz",
        landmarks=R + "/takes/{subject}/{take}/landmarks/{chunk}.npz",
    output:
        TRACKING + "/photometric/{chunk}.npz",
    log:
        R + "/logs/photometric/{subject}-{take}-{chunk}.log",
    benchmark:
        R + "/benchmarks/photometric/{subject}-{take}-{chunk}.tsv"
    resources:
        mem_mb=1500,
        runtime=60,
    params:
        cfg=cfg_of("tracking.fit", "tracking.motion", "refinement.appearance", "refinement.fit"),
        code=code_of("tracking/photometric"),
        source=mono_source,
        frames=lambda wildcards: frames_in(wildcards.chunk),
    script:
        "../scripts/tracking/photometric.py"


if CONFIG.refinement.photometric:

    rule photometric_join:
        """Joins the refined frames of a take, smooth over time: tracking/fit.npz."""
        input:
            tracker=tracker_of,
            identity=R + "/subjects/{subject}/identity.npz",
            fit=landmark_fit(),
            chunks=per_chunk(TRACKING + "/photometric/{chunk}.npz"),
            landmarks=per_chunk(R + "/takes/{subject}/{take}/landmarks/{chunk}.npz"),
        output:
            fit=TRACKING + "/fit.npz",
        log:
            R + "/logs/photometric_join/{subject}-{take}.log",
        benchmark:
            R + "/benchmarks/photometric_join/{subject}-{take}.tsv"
        resources:
            mem_mb=lambda wildcards: 1000 + 2 * len(take_of(wildcards).frames),
            runtime=60,
        params:
            cfg=cfg_of("tracking.fit", "tracking.motion", "refinement.join"),
            code=code_of("tracking/photometric_join"),
            fps=lambda wildcards: take_of(wildcards).fps,
        script:
            "../scripts/tracking/photometric_join.py"


rule corrective_layer:
    """Offsets of the vertices outside the model's space: tracking/offsets/{chunk}.npy."""
    input:
        unpack(mono_inputs),
        tracker=tracker_of,
        identity=R + "/subjects/{subject}/identity.npz",
        fit=TRACKING + "/fit.npz",
        appearance=TRACKING + "/appearance.npz",
        landmarks=R + "/takes/{subject}/{take}/landmarks/{chunk}.npz",
    output:
        TRACKING + "/offsets/{chunk}.npy",
    log:
        R + "/logs/corrective_layer/{subject}-{take}-{chunk}.log",
    benchmark:
        R + "/benchmarks/corrective_layer/{subject}-{take}-{chunk}.tsv"
    resources:
        mem_mb=1500,
        runtime=60,
    params:
        cfg=cfg_of("tracking.fit", "tracking.motion", "refinement.appearance", "refinement.offsets"),
        code=code_of("tracking/corrective_layer"),
        source=mono_source,
        frames=lambda wildcards: frames_in(wildcards.chunk),
    script:
        "../scripts/tracking/corrective_layer.py"


rule residuals:
    """How much of the images of a chunk each step leaves unexplained: residuals/<step>/."""
    input:
        unpack(mono_inputs),
        unpack(mesh_offsets),
        tracker=tracker_of,
        identity=R + "/subjects/{subject}/identity.npz",
        landmark_fit=landmark_fit(),
        fit=TRACKING + "/fit.npz",
        appearance=TRACKING + "/appearance.npz",
        landmarks=R + "/takes/{subject}/{take}/landmarks/{chunk}.npz",
    output:
        tables=[TRACKING + f"/residuals/{step}/{{chunk}}.tsv" for step in refinement_steps()]
        or [TRACKING + "/residuals/landmarks/{chunk}.tsv"],
        overlay=TRACKING + "/residuals/overlay/{chunk}.png",
    log:
        R + "/logs/residuals/{subject}-{take}-{chunk}.log",
    benchmark:
        R + "/benchmarks/residuals/{subject}-{take}-{chunk}.tsv"
    resources:
        mem_mb=1500,
        runtime=60,
    params:
        cfg=cfg_of(
            "tracking.fit", "tracking.motion", "refinement.appearance", "refinement.overlay_frames"
        ),
        code=code_of("tracking/residuals"),
        source=mono_source,
        frames=lambda wildcards: frames_in(wildcards.chunk),
        steps=refinement_steps() or ["landmarks"],
    script:
        "../scripts/tracking/residuals.py"


rule ablations:
    """Joins the residuals of all takes, a row a take and step: evaluation/ablations.tsv."""
    input:
        tables=ablation_tables,
    output:
        table=report(
            R + "/evaluation/ablations.tsv",
            category="Tables",
            labels={"table": "refinements of the track"},
            caption="../report/ablations.rst",
        ),
    log:
        R + "/logs/ablations.log",
    benchmark:
        R + "/benchmarks/ablations.tsv"
    localrule: True
    resources:
        mem_mb=500,
        runtime=10,
    params:
        code=code_of("tracking/ablations"),
    script:
        "../scripts/tracking/ablations.py"
