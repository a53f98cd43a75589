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
        code=code_of("correction/layers"),
        frames=lambda wildcards: frames_in(wildcards.chunk),
    script:
        "../scripts/correction/layers.py"


NEUTRAL_PAIR = R + "/takes/{subject}/{take}/correction/neutral_pair.npz"


def neutral_pair_of(subject):
    """The neutral pair of a subject: that of their reference take."""
    return NEUTRAL_PAIR.format(subject=subject, take=takes("tattoo", subject)[0].take)


def neutral_frame(wildcards):
    """Frame of a take that shows the neutral: the first of a rig take, the marked one of a video."""
    take = take_of(wildcards)
    return CONFIG.correction.neutral_frames.get(take.name, take.first)


def neutral_of_take(wildcards):
    """The neutral pair of a video that has a neutral frame (use with `unpack`)."""
    marked = take_of(wildcards).name in CONFIG.correction.neutral_frames
    return {"neutral_of_take": NEUTRAL_PAIR.format(**wildcards)} if marked else {}


def neutral_takes():
    """Takes whose neutral pairs are used: reference takes, and videos with a neutral frame."""
    first = [takes("tattoo", subject)[0] for subject in subjects("tattoo")]
    return first + [
        take for take in takes("video") if take.name in CONFIG.correction.neutral_frames
    ]


rule neutral_pair:
    """Coarse and accurate neutral of a take: neutral_pair.npz (Lips16 4.2, D of eq. 1)."""
    input:
        template=R + "/face/template.npz",
        tracker=tracker_of,
        accurate=of_reference_take(R + "/takes/{subject}/{take}/multiview/neutral.npz"),
        coarse=per_chunk(R + "/takes/{subject}/{take}/tracking/C/{chunk}.npy"),
        fit=R + "/takes/{subject}/{take}/tracking/fit.npz",
        features=per_chunk(R + "/takes/{subject}/{take}/correction/features/{chunk}.npz"),
        correspondence=R + "/subjects/{subject}/correspondence.npz",
        identity=R + "/subjects/{subject}/identity.npz",
    output:
        pair=NEUTRAL_PAIR,
        overlay=R + "/takes/{subject}/{take}/correction/overlay/neutral_pair.png",
    log:
        R + "/logs/neutral_pair/{subject}-{take}.log",
    benchmark:
        R + "/benchmarks/neutral_pair/{subject}-{take}.tsv"
    resources:
        mem_mb=1000,
        runtime=20,
    params:
        cfg=cfg_of("correction.layers"),
        code=code_of("correction/neutral_pair"),
        frame=neutral_frame,
    script:
        "../scripts/correction/neutral_pair.py"
