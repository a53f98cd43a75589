"""A finer sequence than C (Mono13 7): detail/flow/{chunk}.npy, in the topology of C.

For the takes of `detail.takes`; no other stage reads it.
"""


def detail_takes():
    """Rows of the takes that are refined, in the order of the configuration."""
    return [_TAKES[name] for name in CONFIG.detail.takes]


def detail_outputs():
    """Files of every take that is refined."""
    return [
        path
        for take in detail_takes()
        for path in expand_chunks(
            R + "/takes/{subject}/{take}/detail/flow/{chunk}.npy", take.subject, take.take
        )
    ]


rule detail_flow:
    """Corrects C of a chunk by flow from textured to true frames: detail/flow/{chunk}.npy."""
    input:
        unpack(take_images),
        tracker=tracker_of,
        fit=R + "/takes/{subject}/{take}/tracking/fit.npz",
        coarse=per_chunk(R + "/takes/{subject}/{take}/tracking/C/{chunk}.npy"),
    output:
        meshes=R + "/takes/{subject}/{take}/detail/flow/{chunk}.npy",
        quality=R + "/takes/{subject}/{take}/detail/quality/{chunk}.tsv",
        overlay=R + "/takes/{subject}/{take}/detail/overlay/{chunk}.png",
        start=R + "/takes/{subject}/{take}/tracking/residuals/before_flow/{chunk}.tsv",
        flow=R + "/takes/{subject}/{take}/tracking/residuals/flow/{chunk}.tsv",
    log:
        R + "/logs/detail_flow/{subject}-{take}-{chunk}.log",
    benchmark:
        R + "/benchmarks/detail_flow/{subject}-{take}-{chunk}.tsv"
    resources:
        mem_mb=2000,
        runtime=120,
    params:
        cfg=cfg_of("detail.face_px", "detail.flow", "detail.deformation", "detail.overlay_frames"),
        code=code_of("detail/detail_flow"),
        source=take_source,
        frames=lambda wildcards: frames_in(wildcards.chunk),
        span=lambda wildcards: [take_of(wildcards).first, take_of(wildcards).last],
    script:
        "../scripts/detail/detail_flow.py"
