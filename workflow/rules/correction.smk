"""Correction layers: what turns the coarse mesh into the accurate one (Lips16 4.2)."""


rule layers:
    """Nine numbers a triangle of the mask for every frame of a chunk: layers/{chunk}.npz."""
    input:
        accurate=P.accurate,
        accurate_quality=P.multiview_quality,
        drift=per_chunk(P.drift),
        accurate_neutral=P.neutral,
        coarse=P.coarse,
        fit=P.fit,
        correspondence=P.correspondence,
        tracker=tracker_of,
    output:
        layers=P.layers,
        quality=P.correction_quality,
        overlay=P.correction_overlay,
    log:
        P.log("layers", "chunk"),
    benchmark:
        P.benchmark("layers", "chunk")
    resources:
        mem_mb=growing(1500),
        runtime=growing(20),
    params:
        cfg=cfg_of("correction.layers", "multiview.lost"),
        code=code_of("correction/layers"),
        frames=chunk_frames,
    script:
        "../scripts/correction/layers.py"


def neutral_pair_of(subject):
    """The neutral pair of a subject: that of their reference take."""
    return P.neutral_pair.format(subject=subject, take=takes("tattoo", subject)[0].take)


def neutral_frame(wildcards):
    """Frame of a take that shows the neutral: the first of a rig take, the marked one of a video."""
    take = take_of(wildcards)
    return CONFIG.correction.neutral_frames.get(take.name, take.first)


def rest_frame(wildcards):
    """Frame of a take that is known to show the neutral; None: of this video nobody said so."""
    take = take_of(wildcards)
    first = take.first if take.role == "tattoo" else None
    return CONFIG.correction.neutral_frames.get(take.name, first)


def neutral_of_take(wildcards):
    """The neutral pair of a video that has a neutral frame (use with `unpack`)."""
    marked = take_of(wildcards).name in CONFIG.correction.neutral_frames
    return {"neutral_of_take": P.neutral_pair.format(**wildcards)} if marked else {}


def neutral_takes():
    """Takes whose neutral pairs are used: reference takes, and videos with a neutral frame."""
    first = [takes("tattoo", subject)[0] for subject in subjects("tattoo")]
    return first + [
        take for take in takes("video") if take.name in CONFIG.correction.neutral_frames
    ]


rule neutral_pair:
    """Coarse and accurate neutral of a take: neutral_pair.npz (Lips16 4.2, D of eq. 1)."""
    input:
        template=P.template,
        tracker=tracker_of,
        accurate=of_reference_take(P.neutral),
        coarse=per_chunk(P.coarse),
        fit=P.fit,
        features=per_chunk(P.features),
        correspondence=P.correspondence,
        identity=P.identity,
    output:
        pair=P.neutral_pair,
        overlay=P.neutral_pair_overlay,
    log:
        P.log("neutral_pair", "take"),
    benchmark:
        P.benchmark("neutral_pair", "take")
    resources:
        mem_mb=growing(1000),
        runtime=growing(20),
    params:
        cfg=cfg_of("correction.layers"),
        code=code_of("correction/neutral_pair"),
        frame=neutral_frame,
    script:
        "../scripts/correction/neutral_pair.py"
