"""Sequences finer than C: corrective flow (Mono13 7), and relief from shading (Mono13 8).

Flow: detail/flow/, in the topology of C, for the takes of `detail.takes`. Relief: detail/relief/, in
a subdivided topology, for the takes of `detail.relief.takes`, from the flow where a take has it, else
from C. No other stage reads them. Relief is of each frame alone; a second rule averages the normals
over a window of frames, which reaches into the neighbouring chunks.
"""

#: What the fine meshes and their images depend on.
RELIEF_SCENE = [f"detail.relief.{key}" for key in ("levels", "spacing_mm", "face_px")]
#: Priors of the relief and noise of the image: `ReliefSettings`.
RELIEF_PRIORS = [
    f"detail.relief.{key}"
    for key in (
        "detail_mm",
        "curvature_sigma",
        "displacement_sigma_mm",
        "standing_share",
        "noise_floor",
        "misplaced_mm",
        "iterations",
    )
]


def detail_takes():
    """Rows of the takes that are refined, in the order of the configuration."""
    return [_TAKES[name] for name in CONFIG.detail.takes]


def detail_outputs():
    """Files of every take that is refined."""
    flow = of_takes(P.flow, detail_takes())
    return flow + [
        path
        for pattern in (P.relief_light, P.relief, P.relief_meshes)
        for path in of_takes(pattern, relief_takes())
    ]


def relief_takes():
    """Rows of the takes that get relief, in the order of the configuration."""
    return [_TAKES[name] for name in CONFIG.detail.relief.takes]


def detail_residuals():
    """Residuals before and after the flow, and before and after the relief."""
    flow = residuals_of(detail_takes(), ("before_flow", "flow"))
    return flow + residuals_of(relief_takes(), ("before_relief", "relief"))


def mesh_before_relief(wildcards):
    """Pattern of the chunks of the sequence that the relief is added to."""
    return P.flow if take_of(wildcards) in detail_takes() else P.coarse


def meshes_before_relief(wildcards):
    """All chunks of that sequence."""
    return of_chunks(mesh_before_relief(wildcards), wildcards)


def chunk_before_relief(wildcards):
    """The wildcards' chunk of that sequence, as a list of one."""
    return [mesh_before_relief(wildcards).format(**wildcards)]


def near_reliefs(wildcards):
    """Relief of the chunks into which the window about a chunk's frames reaches."""
    near = near_chunks(wildcards, CONFIG.detail.relief.window // 2)
    return [fill(P.relief, wildcards, chunk=chunk) for chunk in near]


rule detail_flow:
    """Corrects C of a chunk by flow from textured to true frames: detail/flow/{chunk}.npy."""
    input:
        images=mono_images,
        tracker=tracker_of,
        fit=P.fit,
        coarse=per_chunk(P.coarse),
    output:
        meshes=P.flow,
        quality=P.flow_quality,
        overlay=P.flow_overlay,
        start=P.residuals.replace("{step}", "before_flow"),
        flow=P.residuals.replace("{step}", "flow"),
    log:
        P.log("detail_flow", "chunk"),
    benchmark:
        P.benchmark("detail_flow", "chunk")
    resources:
        mem_mb=growing(2000),
        runtime=growing(30, for_each_frame=0.3),
    params:
        cfg=cfg_of("detail.face_px", "detail.flow", "detail.deformation", "detail.overlay_frames"),
        code=code_of("detail/detail_flow"),
        source=mono_source,
        frames=chunk_frames,
        span=take_span,
    script:
        "../scripts/detail/detail_flow.py"


rule relief_start:
    """Light, albedo and noise of a take from its first frames: detail/relief/light_start.npz."""
    input:
        images=mono_images,
        tracker=tracker_of,
        fit=P.fit,
        meshes=meshes_before_relief,
    output:
        light=P.relief_start,
        topology=P.relief_topology,
    log:
        P.log("relief_start", "take"),
    benchmark:
        P.benchmark("relief_start", "take")
    resources:
        mem_mb=growing(2000),
        runtime=growing(30),
    params:
        cfg=cfg_of(*RELIEF_SCENE, *RELIEF_PRIORS, "detail.relief.light_frames"),
        code=code_of("detail/relief_start"),
        source=mono_source,
        span=take_span,
    script:
        "../scripts/detail/relief_start.py"


rule relief_evidence:
    """What each frame of a chunk tells of the light, on its relief: detail/relief/light/{chunk}.npz."""
    input:
        images=mono_images,
        tracker=tracker_of,
        fit=P.fit,
        meshes=chunk_before_relief,
        start=P.relief_start,
    output:
        evidence=P.relief_evidence,
    log:
        P.log("relief_evidence", "chunk"),
    benchmark:
        P.benchmark("relief_evidence", "chunk")
    resources:
        mem_mb=growing(2000),
        runtime=growing(60),
    params:
        cfg=cfg_of(*RELIEF_SCENE, *RELIEF_PRIORS),
        code=code_of("detail/relief_evidence"),
        source=mono_source,
        frames=chunk_frames,
    script:
        "../scripts/detail/relief_evidence.py"


rule relief_light:
    """One light that fits all frames, albedo and noise under it: detail/relief/light.npz."""
    input:
        images=mono_images,
        tracker=tracker_of,
        fit=P.fit,
        meshes=meshes_before_relief,
        start=P.relief_start,
        evidence=per_chunk(P.relief_evidence),
    output:
        light=P.relief_light,
    log:
        P.log("relief_light", "take"),
    benchmark:
        P.benchmark("relief_light", "take")
    resources:
        mem_mb=growing(2000),
        runtime=growing(30),
    params:
        cfg=cfg_of(*RELIEF_SCENE, *RELIEF_PRIORS),
        code=code_of("detail/relief_light"),
        source=mono_source,
        span=take_span,
    script:
        "../scripts/detail/relief_light.py"


rule relief:
    """Relief of each frame of a chunk: detail/relief/frames/{chunk}.npz."""
    input:
        images=mono_images,
        tracker=tracker_of,
        fit=P.fit,
        meshes=chunk_before_relief,
        light=P.relief_light,
    output:
        relief=P.relief,
    log:
        P.log("relief", "chunk"),
    benchmark:
        P.benchmark("relief", "chunk")
    resources:
        mem_mb=growing(2000),
        runtime=growing(60),
    params:
        cfg=cfg_of(*RELIEF_SCENE, *RELIEF_PRIORS),
        code=code_of("detail/relief"),
        source=mono_source,
        frames=chunk_frames,
    script:
        "../scripts/detail/relief.py"


rule relief_meshes:
    """Relief with averaged normals, as meshes, normal and displacement maps: detail/relief/{chunk}.npy."""
    input:
        images=mono_images,
        tracker=tracker_of,
        fit=P.fit,
        meshes=chunk_before_relief,
        light=P.relief_light,
        reliefs=near_reliefs,
    output:
        meshes=P.relief_meshes,
        maps=directory(P.normal_maps),
        displacements=directory(P.displacement_maps),
        quality=P.relief_quality,
        overlay=P.relief_overlay,
        start=P.residuals.replace("{step}", "before_relief"),
        after=P.residuals.replace("{step}", "relief"),
    log:
        P.log("relief_meshes", "chunk"),
    benchmark:
        P.benchmark("relief_meshes", "chunk")
    resources:
        mem_mb=growing(2000),
        runtime=growing(60),
    params:
        cfg=cfg_of(
            *RELIEF_SCENE,
            "detail.relief.window",
            "detail.relief.position_weight",
            "detail.relief.map_px",
            "detail.relief.overlay_frames",
        ),
        code=code_of("detail/relief_meshes"),
        source=mono_source,
        frames=chunk_frames,
        span=take_span,
    script:
        "../scripts/detail/relief_meshes.py"
