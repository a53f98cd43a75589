"""Better lips for a video (Lips16 6): apply/<subject>/<take>/ with meshes, weights, USD, overlay."""

APPLIED = R + "/apply/{subject}/{take}"


def apply_model(wildcards):
    """The regressor that the configuration names, for this subject."""
    return f"{R}/models/{CONFIG.apply.regressor.replace('{subject}', wildcards.subject)}.h5"


def apply_neutral(wildcards):
    """Neutrals that tell a regressor what it does not know: the person's, the take's (`unpack`)."""
    name = CONFIG.apply.regressor.replace("{subject}", wildcards.subject)
    known = wildcards.subject in trained_on(name, trained_subjects())
    if known or not takes("tattoo", wildcards.subject):
        return neutral_of_take(wildcards)
    return {"neutral_pair": neutral_pair_of(wildcards.subject), **neutral_of_take(wildcards)}


def apply_exports():
    """Outputs of a corrected take; USD and OBJ as the configuration asks."""
    outputs = {
        "corrected": APPLIED + "/corrected.npy",
        "mesh": APPLIED + "/mesh.ply",
        "weights": APPLIED + "/weights.csv",
        "overlay": report(
            APPLIED + "/overlay.mp4",
            category="Corrected takes",
            labels={"take": "{subject}/{take}"},
            caption="../report/overlay.rst",
        ),
        "timeline": report(
            APPLIED + "/timeline.png",
            category="Corrected takes",
            labels={"take": "{subject}/{take}, time line"},
            caption="../report/timeline.rst",
        ),
    }
    if CONFIG.apply.export.usd:
        outputs["usd"] = APPLIED + "/corrected.usdc"
    if CONFIG.apply.export.obj:
        outputs["obj"] = directory(APPLIED + "/obj")
    return outputs


def chunks_around(pattern):
    """Input function: `pattern` for the chunks with a frame that the wildcards' chunk depends on."""

    def files(wildcards):
        frames = frames_in(wildcards.chunk)
        reach = CONFIG.correction.reach_frames(take_of(wildcards).fps)
        near = [
            chunk
            for chunk in chunks(wildcards.subject, wildcards.take)
            if frames_in(chunk)[0] <= frames[-1] + reach
            and frames_in(chunk)[-1] >= frames[0] - reach
        ]
        return [pattern.format(**{**dict(wildcards), "chunk": chunk}) for chunk in near]

    return files


def applied_takes():
    """Takes to be corrected, `subject/take`: those named, or all of role `video`."""
    rows = takes("video")
    return CONFIG.apply.takes or [
        take.name for take in rows if take.name not in CONFIG.landmarks.training_takes
    ]


rule apply:
    """Corrects a chunk of a take and draws original, base and corrected side by side."""
    input:
        unpack(mono_inputs),
        unpack(apply_neutral),
        tracker=tracker_of,
        identity=R + "/subjects/{subject}/identity.npz",
        fit=R + "/takes/{subject}/{take}/tracking/fit.npz",
        coarse=chunks_around(R + "/takes/{subject}/{take}/tracking/C/{chunk}.npy"),
        features=chunks_around(R + "/takes/{subject}/{take}/correction/features/{chunk}.npz"),
        model=apply_model,
    output:
        corrected=APPLIED + "/chunks/{chunk}.npy",
        overlay=APPLIED + "/chunks/{chunk}.mp4",
        quality=APPLIED + "/quality/{chunk}.tsv",
    log:
        R + "/logs/apply/{subject}-{take}-{chunk}.log",
    benchmark:
        R + "/benchmarks/apply/{subject}-{take}-{chunk}.tsv"
    resources:
        mem_mb=1500,
        runtime=60,
    params:
        cfg=cfg_of("apply.overlay", "correction.integration", "correction.image"),
        code=code_of("apply/apply"),
        frames=lambda wildcards: frames_in(wildcards.chunk),
        fps=lambda wildcards: take_of(wildcards).fps,
        source=mono_source,
        camera=mono_camera,
    script:
        "../scripts/apply/apply.py"


rule apply_export:
    """Joins the chunks of a take into the files that Blender, Maya or Unreal open."""
    input:
        tracker=tracker_of,
        fit=R + "/takes/{subject}/{take}/tracking/fit.npz",
        corrected=per_chunk(APPLIED + "/chunks/{chunk}.npy"),
        overlays=per_chunk(APPLIED + "/chunks/{chunk}.mp4"),
        quality=per_chunk(APPLIED + "/quality/{chunk}.tsv"),
    output:
        **apply_exports(),
    log:
        R + "/logs/apply_export/{subject}-{take}.log",
    benchmark:
        R + "/benchmarks/apply_export/{subject}-{take}.tsv"
    resources:
        mem_mb=2000,
        runtime=30,
    params:
        cfg=cfg_of("apply.export"),
        code=code_of("apply/apply_export"),
        fps=lambda wildcards: take_of(wildcards).fps,
    script:
        "../scripts/apply/apply_export.py"


rule makeup:
    """Draws virtual make-up and a checkerboard on the corrected face (Mono13 9)."""
    input:
        unpack(mono_inputs),
        tracker=tracker_of,
        identity=R + "/subjects/{subject}/identity.npz",
        fit=R + "/takes/{subject}/{take}/tracking/fit.npz",
        appearance=R + "/takes/{subject}/{take}/tracking/appearance.npz",
        corrected=APPLIED + "/chunks/{chunk}.npy",
    output:
        video=APPLIED + "/makeup/{chunk}.mp4",
        image=APPLIED + "/makeup/{chunk}.png",
    log:
        R + "/logs/makeup/{subject}-{take}-{chunk}.log",
    benchmark:
        R + "/benchmarks/makeup/{subject}-{take}-{chunk}.tsv"
    resources:
        mem_mb=1500,
        runtime=60,
    params:
        cfg=cfg_of("apply.makeup", "apply.overlay"),
        code=code_of("apply/makeup"),
        frames=lambda wildcards: frames_in(wildcards.chunk),
        fps=lambda wildcards: take_of(wildcards).fps,
        source=mono_source,
    script:
        "../scripts/apply/makeup.py"


rule makeup_join:
    """Joins the make-up of a take: makeup.mp4, and an image of its first chunk."""
    input:
        videos=per_chunk(APPLIED + "/makeup/{chunk}.mp4"),
        images=per_chunk(APPLIED + "/makeup/{chunk}.png"),
    output:
        video=report(
            APPLIED + "/makeup.mp4",
            category="Corrected takes",
            labels={"take": "{subject}/{take}, make-up"},
            caption="../report/makeup.rst",
        ),
        image=APPLIED + "/makeup.png",
    log:
        R + "/logs/makeup_join/{subject}-{take}.log",
    benchmark:
        R + "/benchmarks/makeup_join/{subject}-{take}.tsv"
    localrule: True
    resources:
        mem_mb=500,
        runtime=20,
    params:
        code=code_of("apply/makeup_join"),
    script:
        "../scripts/apply/makeup_join.py"
