"""Fine relief from shading (Mono13 8): detail/shading/, in a subdivided topology.

For the takes of `detail.shading.takes`, from the corrective flow where `detail.takes` names the take
too, else from C. No other stage reads it. Relief is of each frame alone; a second rule averages the
normals over a window of frames, which reaches into the neighbouring chunks.
"""

SHADING = R + "/takes/{subject}/{take}/detail/shading"


def shading_takes():
    """Rows of the takes that get relief, in the order of the configuration."""
    return [_TAKES[name] for name in CONFIG.detail.shading.takes]


def shading_outputs():
    """Files of every take that gets relief."""
    return [
        path
        for take in shading_takes()
        for name in ("light.npz", "relief/{chunk}.npz", "{chunk}.npy")
        for path in dict.fromkeys(expand_chunks(f"{SHADING}/{name}", take.subject, take.take))
    ]


def detail_residuals():
    """Residuals before and after the flow, and before and after the relief."""
    steps = [(detail_takes(), ("before_flow", "flow"))]
    steps.append((shading_takes(), ("before_shading", "shading")))
    return [
        path
        for rows, names in steps
        for take in rows
        for name in names
        for path in expand_chunks(
            TRACKING + f"/residuals/{name}/{{chunk}}.tsv", take.subject, take.take
        )
    ]


def mesh_before_shading(wildcards):
    """Pattern of the chunks of the sequence that the relief is added to."""
    folder = "/detail/flow" if take_of(wildcards) in detail_takes() else "/tracking/C"
    return f"{R}/takes/{wildcards.subject}/{wildcards.take}{folder}/{{chunk}}.npy"


def meshes_before_shading(wildcards):
    """All chunks of that sequence."""
    return expand_chunks(mesh_before_shading(wildcards), wildcards.subject, wildcards.take)


def chunk_before_shading(wildcards):
    """The wildcards' chunk of that sequence, as a list of one."""
    return [mesh_before_shading(wildcards).format(chunk=wildcards.chunk)]


def near_reliefs(wildcards):
    """Relief of the chunks into which the window about a chunk's frames reaches."""
    frames, half = frames_in(wildcards.chunk), CONFIG.detail.shading.window // 2
    names = [
        chunk
        for chunk in chunks(wildcards.subject, wildcards.take)
        if frames_in(chunk)[-1] >= frames[0] - half and frames_in(chunk)[0] <= frames[-1] + half
    ]
    return [f"{SHADING}/relief/{chunk}.npz".format(**wildcards) for chunk in names]


def take_span(wildcards):
    """First and last frame of the wildcards' take."""
    return [take_of(wildcards).first, take_of(wildcards).last]


rule shading_light:
    """One light, albedo and noise of a take from its first frames: detail/shading/light.npz."""
    input:
        unpack(take_images),
        tracker=tracker_of,
        fit=TRACKING + "/fit.npz",
        meshes=meshes_before_shading,
    output:
        light=SHADING + "/light.npz",
        topology=SHADING + "/topology.obj",
    log:
        R + "/logs/shading_light/{subject}-{take}.log",
    benchmark:
        R + "/benchmarks/shading_light/{subject}-{take}.tsv"
    resources:
        mem_mb=2000,
        runtime=30,
    params:
        cfg=cfg_of(
            "detail.shading.levels",
            "detail.shading.face_px",
            "detail.shading.light_frames",
            "detail.shading.detail_mm",
        ),
        code=code_of("detail/shading_light"),
        source=take_source,
        span=take_span,
    script:
        "../scripts/detail/shading_light.py"


rule shading_relief:
    """Relief of each frame of a chunk: detail/shading/relief/{chunk}.npz."""
    input:
        unpack(take_images),
        tracker=tracker_of,
        fit=TRACKING + "/fit.npz",
        meshes=chunk_before_shading,
        light=SHADING + "/light.npz",
    output:
        relief=SHADING + "/relief/{chunk}.npz",
    log:
        R + "/logs/shading_relief/{subject}-{take}-{chunk}.log",
    benchmark:
        R + "/benchmarks/shading_relief/{subject}-{take}-{chunk}.tsv"
    resources:
        mem_mb=2000,
        runtime=60,
    params:
        cfg=cfg_of(
            "detail.shading.levels",
            "detail.shading.face_px",
            "detail.shading.detail_mm",
            "detail.shading.curvature_sigma",
            "detail.shading.displacement_sigma_mm",
            "detail.shading.noise_floor",
            "detail.shading.misplaced_mm",
            "detail.shading.iterations",
        ),
        code=code_of("detail/shading_relief"),
        source=take_source,
        frames=lambda wildcards: frames_in(wildcards.chunk),
    script:
        "../scripts/detail/shading_relief.py"


rule shading_meshes:
    """Relief with averaged normals, as meshes and normal maps: detail/shading/{chunk}.npy."""
    input:
        unpack(take_images),
        tracker=tracker_of,
        fit=TRACKING + "/fit.npz",
        meshes=chunk_before_shading,
        light=SHADING + "/light.npz",
        reliefs=near_reliefs,
    output:
        meshes=SHADING + "/{chunk}.npy",
        maps=directory(SHADING + "/normals/{chunk}"),
        quality=SHADING + "/quality/{chunk}.tsv",
        overlay=SHADING + "/overlay/{chunk}.png",
        start=TRACKING + "/residuals/before_shading/{chunk}.tsv",
        after=TRACKING + "/residuals/shading/{chunk}.tsv",
    log:
        R + "/logs/shading_meshes/{subject}-{take}-{chunk}.log",
    benchmark:
        R + "/benchmarks/shading_meshes/{subject}-{take}-{chunk}.tsv"
    resources:
        mem_mb=2000,
        runtime=60,
    params:
        cfg=cfg_of(
            "detail.shading.levels",
            "detail.shading.face_px",
            "detail.shading.window",
            "detail.shading.position_weight",
            "detail.shading.map_px",
            "detail.shading.overlay_frames",
        ),
        code=code_of("detail/shading_meshes"),
        source=take_source,
        frames=lambda wildcards: frames_in(wildcards.chunk),
        span=take_span,
    script:
        "../scripts/detail/shading_meshes.py"
