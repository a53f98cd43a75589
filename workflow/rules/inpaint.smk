"""The lip tattoo painted over (Lips16 3.2.1): the monocular frames that the tracker may see."""


def plain_take(wildcards):
    """The one take of a subject without tattoo."""
    return takes("plain", wildcards.subject)[0]


def of_plain_take(pattern):
    """Input function: `pattern` for the first chunk of the subject's plain take."""
    return lambda wildcards: of_chunks(pattern, plain_take(wildcards))[0]


rule plain_texture:
    """The texture of the lips without tattoo: plain_texture.exr, from all cameras of the plain take."""
    input:
        template=P.template,
        neutral=of_plain_take(P.neutral),
        cameras=of_plain_take(P.cameras),
        manifest=lambda wildcards: captured_neutral(plain_take(wildcards)),
    output:
        texture=P.plain_texture,
        overlay=P.plain_texture_overlay,
    log:
        P.log("plain_texture", "subject"),
    benchmark:
        P.benchmark("plain_texture", "subject")
    resources:
        mem_mb=growing(1500, for_mono=320),
        runtime=growing(20),
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
        template=P.template,
        plain=P.plain_texture,
        neutral=P.neutral,
        cameras=P.cameras,
        manifest=captured_neutral,
    output:
        reference=P.tattoo_reference,
        overlay=P.tattoo_reference_overlay,
    log:
        P.log("inpaint_reference", "take"),
    benchmark:
        P.benchmark("inpaint_reference", "take")
    resources:
        mem_mb=growing(1500, for_mono=300),
        runtime=growing(20),
    params:
        cfg=cfg_of("inpaint.domain", "inpaint.mask", "capture.frontal_camera"),
        code=code_of("inpaint/inpaint_reference"),
        neutral=first_frame,
        source=source_of,
    script:
        "../scripts/inpaint/inpaint_reference.py"


rule inpaint:
    """Frames of the frontal camera without tattoo: inpaint/{chunk}/<frame>.png (Lips16 3.2.1)."""
    input:
        template=P.template,
        plain=P.plain_texture,
        reference=P.tattoo_reference,
        meshes=P.accurate,
        cameras=P.cameras,
        manifest=captured_chunk,
    output:
        frames=directory(P.inpainted),
        quality=P.inpaint_quality,
        overlay=P.inpaint_overlay,
    log:
        P.log("inpaint", "chunk"),
    benchmark:
        P.benchmark("inpaint", "chunk")
    resources:
        mem_mb=growing(1500, for_mono=250),
        runtime=growing(10, for_each_frame=0.1),
    params:
        cfg=cfg_of(
            "inpaint.domain",
            "inpaint.shading",
            "inpaint.opening",
            "inpaint.composite",
            "capture.frontal_camera",
        ),
        code=code_of("inpaint/inpaint"),
        frames=chunk_frames,
        source=source_of,
    script:
        "../scripts/inpaint/inpaint.py"
