"""Better lips for a video (Lips16 6): apply/<subject>/<take>/ with meshes, weights, USD, overlay."""

from vermilion.config.face_model import TITLES
from vermilion.faces.build import face_model_of
from vermilion.storage.errors import ModelFileError

#: File of a regressor that was trained elsewhere; None where there is none.
GIVEN_MODEL = CONFIG.apply.file(CONFIG.face_model.name)


def refuse_other_face_models():
    """End the run where a regressor's file was trained for another face model; damage is its job's to name."""
    given = {"apply.model": GIVEN_MODEL, "evaluation.generic": CONFIG.evaluation.generic}
    for key, file in given.items():
        if not file:
            continue
        from vermilion.regression.model import model_topology

        try:
            trained_for = face_model_of(model_topology(file))
        except ModelFileError:
            continue
        if trained_for not in (None, CONFIG.face_model.name):
            raise WorkflowError(
                f"{ORIGIN}, key {key}: found {file}, which was trained for the face model {TITLES[trained_for]}; "
                f"expected one for that of this run, {CONFIG.face_model.title}. Name another file, or set "
                "face_model."
            )


if IS_MAIN_PROCESS and not EXTERNAL:  # another tracker's triangles are its own
    refuse_other_face_models()


def apply_regressor(wildcards):
    """Name of the regressor that the configuration names, for this subject."""
    return CONFIG.apply.regressor.replace("{subject}", wildcards.subject)


def apply_model(wildcards):
    """File of that regressor, or of one that was trained elsewhere; none for `regressor: none`."""
    if GIVEN_MODEL:
        return GIVEN_MODEL
    return P.model.format(regressor=apply_regressor(wildcards)) if CONFIG.apply.trains else []


def apply_neutral(wildcards):
    """Neutrals that tell a regressor what it does not know: the person's, the take's (`unpack`)."""
    if not (CONFIG.apply.trains or GIVEN_MODEL):
        return {}
    known = CONFIG.apply.trains and wildcards.subject in trained_on(
        apply_regressor(wildcards), trained_subjects()
    )
    if known or not takes("tattoo", wildcards.subject):
        return neutral_of_take(wildcards)
    return {"neutral_pair": neutral_pair_of(wildcards.subject), **neutral_of_take(wildcards)}


#: Format -> its file or folder among those of a corrected take.
EXPORTED = {
    "usd": "/corrected.usdc",
    "usd_shapes": "/corrected_shapes.usdc",
    "gltf": "/corrected.glb",
    "alembic": "/corrected.abc",
    "obj": "/obj",
    "ply": "/ply",
}

#: Without a regressor, which has a mask of its own, the mask is that of the correspondence.
MASK_KEYS = () if CONFIG.apply.trains or GIVEN_MODEL else ("correspondence",)


def exports_to(folder, overlay, timeline, category):
    """Outputs of a corrected take in a folder, in the formats that the configuration asks for."""
    outputs = {
        "corrected": folder + "/corrected.npy",
        "mesh": folder + "/mesh.ply",
        "weights": folder + "/weights.csv",
        "overlay": in_report(overlay, category, "overlay", take="{subject}/{take}"),
        "timeline": in_report(timeline, category, "timeline", take="{subject}/{take}, time line"),
    }
    options = CONFIG.apply.export
    for name in options.formats:
        path = folder + EXPORTED[name]
        outputs[name] = path if "." in EXPORTED[name] else directory(path)
    if options.topology == "full":
        outputs["full"] = folder + "/full.npy"
    if CONFIG.apply.head_of(""):
        outputs["on_head"] = folder + "/head.npy"
    if options.live_link:
        outputs["live_link"] = folder + "/live_link.csv"
    if options.rig:
        outputs["rig"] = folder + "/rig.csv"
        outputs["person"] = folder + "/rig_person.obj"
        outputs["corrective"] = folder + "/rig_corrective.obj"
    if options.flame:
        outputs["flame"] = folder + "/flame.npz"
    if options.plate:
        outputs["plate"] = directory(folder + "/plate")
    if CONFIG.tracking.image_fit.enabled:
        outputs["albedo"] = folder + "/albedo.png"
    return outputs


def exported_files(folder):
    """Name -> its file, of what the configuration asks for and that is one file."""
    options = CONFIG.apply.export
    asked = {name: EXPORTED[name] for name in options.formats}
    if CONFIG.tracking.image_fit.enabled:
        asked["albedo"] = "/albedo.png"
    if options.live_link:
        asked["live_link"] = "/live_link.csv"
    if options.rig:
        asked["rig"] = "/rig.csv"
    return {name: folder + path for name, path in asked.items() if "." in path}


def exports_need(wildcards):
    """What the exported files need beyond the corrected chunks (use with `unpack`)."""
    needed = {"identity": P.identity.format(subject=wildcards.subject), **own_frame(wildcards)}
    options = CONFIG.apply.export
    if options.topology == "full" or options.live_link:
        needed["studio"] = P.studio_model
    head = CONFIG.apply.head_of(wildcards.subject)
    if head:
        needed["head"] = head
        needed["binding"] = P.head_binding.format(subject=wildcards.subject)
        needed["labels"] = P.head_labels.format(subject=wildcards.subject)
    if options.rig:
        needed["rig"] = options.rig
    if options.flame:
        needed["parameters"] = sequence_of(wildcards).source
        needed["flame_model"] = CONFIG.tracking.external.flame
    if options.plate:
        needed["images"] = mono_images(wildcards)
    if CONFIG.tracking.image_fit.enabled:
        needed["appearance"] = P.appearance.format(**wildcards)
    return needed


def chunks_around(pattern):
    """Input function: `pattern` for the chunks with a frame that the wildcards' chunk depends on."""

    def files(wildcards):
        near = near_chunks(wildcards, CONFIG.correction.reach_frames(take_fps(wildcards)))
        return [fill(pattern, wildcards, chunk=chunk) for chunk in near]

    return files


def applied_takes():
    """Takes to be corrected: those named, or all of role `video`."""
    if CONFIG.apply.takes:
        return [_TAKES[name] for name in CONFIG.apply.takes]
    return [take for take in takes("video") if take.name not in CONFIG.landmarks.training_takes]


rule apply:
    """Corrects a chunk of a take and draws original, base and corrected side by side."""
    input:
        unpack(apply_neutral),
        images=chunk_images,
        tracker=tracker_of,
        identity=P.identity,
        fit=P.fit,
        coarse=chunks_around(P.coarse),
        features=chunks_around(P.features),
        model=apply_model,
    output:
        corrected=P.corrected,
        overlay=P.apply_clip,
        quality=P.apply_quality,
    log:
        P.log("apply", "chunk"),
    benchmark:
        P.benchmark("apply", "chunk")
    resources:
        mem_mb=growing(1500),
        runtime=growing(60),
    params:
        cfg=cfg_of(
            "apply.overlay",
            "correction.integration",
            "correction.image",
            "evaluation.measures.surface",
            *MASK_KEYS,
        ),
        code=code_of("apply/apply"),
        frames=chunk_frames,
        fps=take_fps,
        source=chunk_source,
        camera=mono_camera,
    script:
        "../scripts/apply/apply.py"


def head_marks(wildcards):
    """Landmarks that were placed on the subject's head by hand; none where they are detected."""
    path = CONFIG.apply.export.head.landmarks
    return path.replace("{subject}", wildcards.subject) if path else []


rule export_head:
    """Lays our face model over a subject's own head, whose topology the exported files have."""
    input:
        tracker=base_model,
        head=lambda wildcards: CONFIG.apply.head_of(wildcards.subject),
        landmarks=head_marks,
        detector=lambda wildcards: [] if head_marks(wildcards) else detector_files(wildcards),
    output:
        binding=P.head_binding,
        labels=P.head_labels,
        landmarks=P.head_landmarks,
        overlay=in_report(P.head_overlay, "Corrected takes", "head", take="{subject}, own head"),
    log:
        P.log("export_head", "subject"),
    benchmark:
        P.benchmark("export_head", "subject")
    resources:
        mem_mb=growing(3000),
        runtime=growing(30),
    params:
        cfg=detector_cfg("face_model.template_slight_open"),
        code=code_of("apply/export_head"),
        model=detector_path,
    script:
        "../scripts/apply/export_head.py"


rule apply_export:
    """Joins the chunks of a take into the files that Blender, Maya or Unreal open."""
    input:
        unpack(exports_need),
        tracker=tracker_of,
        fit=P.fit,
        corrected=per_chunk(P.corrected),
        overlays=per_chunk(P.apply_clip),
        quality=per_chunk(P.apply_quality),
    output:
        **exports_to(P.applied, P.apply_overlay, P.timeline, "Corrected takes"),
    log:
        P.log("apply_export", "take"),
    benchmark:
        P.benchmark("apply_export", "take")
    resources:
        mem_mb=growing(2000),
        runtime=growing(30),
    params:
        cfg=cfg_of("apply.export"),
        code=code_of("apply/apply_export"),
        fps=take_fps,
        neutral=rest_frame,
        source=mono_source,
    script:
        "../scripts/apply/apply_export.py"


def face_model_said(wildcards):
    """The face model of a take's track, as its page says it."""
    if EXTERNAL:
        return "that of another tracker"
    if wildcards.subject in CONFIG.tracking.scans:
        return CONFIG.face_model.title + ", made from a scan of the person"
    if wildcards.subject in MEASURED:
        return f"{CONFIG.face_model.title}, pupils {MEASURED[wildcards.subject]:g} mm apart"
    return CONFIG.face_model.title


rule lips_page:
    """Puts the video beside its result, the warnings and the files on one page: lips.html."""
    input:
        **exported_files(P.applied),
        tracker=tracker_of,
        fit=P.fit,
        quality=P.quality,
        corrected=P.applied + "/corrected.npy",
        mesh=P.applied + "/mesh.ply",
        weights=P.applied + "/weights.csv",
        overlay=P.apply_overlay,
        track=P.coarse_topology,
    output:
        page=P.lips_page,
    log:
        P.log("lips_page", "take"),
    benchmark:
        P.benchmark("lips_page", "take")
    resources:
        mem_mb=growing(1500),
        runtime=growing(20),
    params:
        code=code_of("apply/lips_page"),
        fps=take_fps,
        face_model=face_model_said,
        correction=lambda wildcards: CONFIG.apply.corrected_by(
            CONFIG.face_model.name, wildcards.subject
        ),
        only=len(TAKES) == 1,
        # Relative: a project that is moved reruns nothing.
        configuration=", ".join(os.path.relpath(path) for path in workflow.configfiles),
    script:
        "../scripts/apply/lips_page.py"


rule makeup:
    """Draws virtual make-up and a checkerboard on the corrected face (Mono13 9)."""
    input:
        images=chunk_images,
        tracker=tracker_of,
        identity=P.identity,
        fit=P.fit,
        appearance=P.appearance,
        corrected=P.corrected,
    output:
        video=P.makeup_chunk + ".mp4",
        image=P.makeup_chunk + ".png",
    log:
        P.log("makeup", "chunk"),
    benchmark:
        P.benchmark("makeup", "chunk")
    resources:
        mem_mb=growing(1500),
        runtime=growing(60),
    params:
        cfg=cfg_of("apply.makeup", "apply.overlay"),
        code=code_of("apply/makeup"),
        frames=chunk_frames,
        fps=take_fps,
        source=chunk_source,
    script:
        "../scripts/apply/makeup.py"


rule makeup_join:
    """Joins the make-up of a take: makeup.mp4, and an image of its first chunk."""
    input:
        videos=per_chunk(P.makeup_chunk + ".mp4"),
        images=per_chunk(P.makeup_chunk + ".png"),
    output:
        video=in_report(P.makeup, "Corrected takes", "makeup", take="{subject}/{take}, make-up"),
        image=P.applied + "/makeup.png",
    log:
        P.log("makeup_join", "take"),
    benchmark:
        P.benchmark("makeup_join", "take")
    localrule: True
    resources:
        mem_mb=growing(800),
        runtime=growing(20),
    params:
        code=code_of("apply/makeup_join"),
    script:
        "../scripts/apply/makeup_join.py"
