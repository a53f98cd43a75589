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


rule neutral_pair:
    """A person's coarse and accurate neutral: neutral_pair.npz (Lips16 4.2, D of eq. 1)."""
    input:
        template=R + "/face/template.npz",
        tracker=tracker_of,
        accurate=of_reference_take(R + "/takes/{subject}/{take}/multiview/neutral.npz"),
        coarse=of_reference_take(R + "/takes/{subject}/{take}/tracking/C/{chunk}.npy"),
        fit=of_reference_take(R + "/takes/{subject}/{take}/tracking/fit.npz"),
        features=of_reference_take(R + "/takes/{subject}/{take}/correction/features/{chunk}.npz"),
        correspondence=R + "/subjects/{subject}/correspondence.npz",
        identity=R + "/subjects/{subject}/identity.npz",
    output:
        pair=R + "/subjects/{subject}/neutral_pair.npz",
        overlay=R + "/subjects/{subject}/overlay/neutral_pair.png",
    log:
        R + "/logs/neutral_pair/{subject}.log",
    benchmark:
        R + "/benchmarks/neutral_pair/{subject}.tsv"
    resources:
        mem_mb=1000,
        runtime=20,
    params:
        cfg=cfg_of("correction.layers"),
        code=code_of("neutral_pair"),
        take=lambda wildcards: reference_take(wildcards).take,
        first=lambda wildcards: reference_take(wildcards).first,
    script:
        "../scripts/neutral_pair.py"
