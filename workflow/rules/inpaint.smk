"""The lip tattoo painted over (Lips16 3.2.1): the monocular frames that the tracker may see."""


def plain_take(wildcards):
    """The one take of a subject without tattoo."""
    return takes("plain", wildcards.subject)[0]


def plain_path(pattern):
    """Input function: `pattern` with the subject's plain take in place of {plain} and {chunk}."""

    def path(wildcards):
        take = plain_take(wildcards)
        chunk = chunks(take.subject, take.take)[0]
        name = pattern.replace("{subject}", take.subject).replace("{plain}", take.take)
        return name.replace("{chunk}", chunk)

    return path


rule plain_texture:
    """The texture of the lips without tattoo: plain_texture.exr, from all cameras of the plain take."""
    input:
        template=R + "/face/template.npz",
        neutral=plain_path(R + "/takes/{subject}/{plain}/multiview/neutral.npz"),
        cameras=plain_path(R + "/takes/{subject}/{plain}/cameras"),
        manifest=plain_path(R + "/takes/{subject}/{plain}/capture/{chunk}.json"),
    output:
        texture=R + "/subjects/{subject}/plain_texture.exr",
        overlay=R + "/subjects/{subject}/overlay/plain_texture.png",
    log:
        R + "/logs/plain_texture/{subject}.log",
    benchmark:
        R + "/benchmarks/plain_texture/{subject}.tsv"
    resources:
        mem_mb=1500,
        runtime=20,
    params:
        cfg=cfg_of("inpaint.domain", "capture.frontal_camera"),
        code=code_of("inpaint/plain_texture"),
        take=lambda wildcards: plain_take(wildcards).take,
        neutral=lambda wildcards: plain_take(wildcards).first,
        source=lambda wildcards: source_of(plain_take(wildcards)),
    script:
        "../scripts/inpaint/plain_texture.py"


rule inpaint_reference:
    """The tattooed neutral as the frontal camera sees it, and where the tattoo is: reference.exr."""
    input:
        template=R + "/face/template.npz",
        plain=R + "/subjects/{subject}/plain_texture.exr",
        neutral=R + "/takes/{subject}/{take}/multiview/neutral.npz",
        cameras=R + "/takes/{subject}/{take}/cameras",
        manifest=first_chunk(R + "/takes/{subject}/{take}/capture/{chunk}.json"),
    output:
        reference=R + "/takes/{subject}/{take}/inpaint/reference.exr",
        overlay=R + "/takes/{subject}/{take}/inpaint/overlay/reference.png",
    log:
        R + "/logs/inpaint_reference/{subject}-{take}.log",
    benchmark:
        R + "/benchmarks/inpaint_reference/{subject}-{take}.tsv"
    resources:
        mem_mb=1500,
        runtime=20,
    params:
        cfg=cfg_of("inpaint.domain", "inpaint.mask", "capture.frontal_camera"),
        code=code_of("inpaint/inpaint_reference"),
        neutral=lambda wildcards: take_of(wildcards).first,
        source=source_of,
    script:
        "../scripts/inpaint/inpaint_reference.py"


rule inpaint:
    """Frames of the frontal camera without tattoo: inpaint/{chunk}/<frame>.png (Lips16 3.2.1)."""
    input:
        template=R + "/face/template.npz",
        plain=R + "/subjects/{subject}/plain_texture.exr",
        reference=R + "/takes/{subject}/{take}/inpaint/reference.exr",
        meshes=R + "/takes/{subject}/{take}/multiview/H/{chunk}.npy",
        cameras=R + "/takes/{subject}/{take}/cameras",
        manifest=R + "/takes/{subject}/{take}/capture/{chunk}.json",
    output:
        frames=directory(R + "/takes/{subject}/{take}/inpaint/{chunk}"),
        quality=R + "/takes/{subject}/{take}/inpaint/quality/{chunk}.tsv",
        overlay=R + "/takes/{subject}/{take}/inpaint/overlay/{chunk}.png",
    log:
        R + "/logs/inpaint/{subject}-{take}-{chunk}.log",
    benchmark:
        R + "/benchmarks/inpaint/{subject}-{take}-{chunk}.tsv"
    resources:
        mem_mb=1500,
        runtime=lambda wildcards: 10 + len(frames_in(wildcards.chunk)) // 10,
    params:
        cfg=cfg_of(
            "inpaint.domain",
            "inpaint.shading",
            "inpaint.opening",
            "inpaint.composite",
            "capture.frontal_camera",
        ),
        code=code_of("inpaint/inpaint"),
        frames=lambda wildcards: frames_in(wildcards.chunk),
        source=source_of,
    script:
        "../scripts/inpaint/inpaint.py"
