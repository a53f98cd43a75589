"""Correction layers: what turns the coarse mesh into the accurate one (Lips16 4.2)."""


rule layers:
    """Nine numbers a triangle of the mask for every frame of a chunk: layers/{chunk}.npz."""
    input:
        accurate=R + "/takes/{subject}/{take}/multiview/H/{chunk}.npy",
        accurate_quality=R + "/takes/{subject}/{take}/multiview/quality/{chunk}.tsv",
        accurate_neutral=R + "/takes/{subject}/{take}/multiview/neutral.npz",
        coarse=R + "/takes/{subject}/{take}/tracking/C/{chunk}.npy",
        fit=R + "/takes/{subject}/{take}/tracking/fit.npz",
        correspondence=R + "/subjects/{subject}/correspondence.npz",
        tracker=tracker_of,
    output:
        layers=R + "/takes/{subject}/{take}/correction/layers/{chunk}.npz",
        quality=R + "/takes/{subject}/{take}/correction/quality/{chunk}.tsv",
        overlay=R + "/takes/{subject}/{take}/correction/overlay/{chunk}.png",
    log:
        R + "/logs/layers/{subject}-{take}-{chunk}.log",
    benchmark:
        R + "/benchmarks/layers/{subject}-{take}-{chunk}.tsv"
    resources:
        mem_mb=1500,
        runtime=20,
    params:
        cfg=cfg_of("correction.layers"),
        code=code_of("layers"),
        frames=lambda wildcards: frames_in(wildcards.chunk),
    script:
        "../scripts/layers.py"
