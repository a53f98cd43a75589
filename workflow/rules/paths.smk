"""Every path of the results, once, by name: `P.fit` is tracking/fit.npz of a take.

Patterns hold wildcards ({subject}, {take}, {chunk}, ...). `P.log` and `P.benchmark` name a job's own
files by what the job is done for. `common.smk` fills patterns in (`per_chunk`, `of_takes`, ...).
"""

R = CONFIG.results
_TAKE = R + "/takes/{subject}/{take}"
_SUBJECT = R + "/subjects/{subject}"
_EVALUATION = R + "/evaluation"
_APPLY = R + "/apply/{subject}/{take}"

#: What a job is done for -> its name in logs and benchmarks.
_JOBS = {
    "run": "",
    "subject": "/{subject}",
    "take": "/{subject}-{take}",
    "chunk": "/{subject}-{take}-{chunk}",
    "clip": "/{subject}-{take}-{clip}",
    "frame": "/{subject}-{take}-{frame}",
    "regressor": "/{regressor}",
}


class P:
    """Patterns of the results' paths."""

    # face_model: one model in three topologies
    face_archive = R + "/face_model/ict-facekit.archive"
    face_models = R + "/face_model/"
    studio_model = R + "/face_model/studio.npz"
    template = R + "/face_model/template.npz"
    tracker = R + "/face_model/tracker.npz"

    # studio: capture folders, and their truth apart
    capture_folder = R + "/captures/{subject}/{take}"
    truth = R + "/truth/{subject}/{take}"

    # capture
    manifest = _TAKE + "/capture/{chunk}.json"
    video_facts = _TAKE + "/capture/video.json"
    capture_quality = _TAKE + "/capture/quality/{chunk}.tsv"
    capture_overlay = _TAKE + "/capture/overlay/{chunk}.png"
    cameras = _TAKE + "/cameras"
    calibration = _TAKE + "/capture/cameras.json"
    cameras_overlay = _TAKE + "/capture/overlay/cameras.png"

    # landmarks
    landmark_models = R + "/landmarks/"
    landmark_model = R + "/landmarks/model.npz"
    faces = _TAKE + "/landmarks/faces/{chunk}.npz"
    followed = _TAKE + "/landmarks/followed.npz"
    followed_table = _TAKE + "/landmarks/followed.tsv"
    landmarks = _TAKE + "/landmarks/{chunk}.npz"
    landmarks_folder = _TAKE + "/landmarks"
    landmarks_around = _TAKE + "/landmarks/around.npz"
    key_frames = _TAKE + "/landmarks/key_frames.npz"
    key_frames_table = _TAKE + "/landmarks/key_frames.tsv"
    views_neutral = _TAKE + "/landmarks/views_neutral.npz"
    views_overlay = _TAKE + "/landmarks/overlay/views_neutral.png"

    # multiview: H
    neutral = _TAKE + "/multiview/neutral.npz"
    neutral_cloud = _TAKE + "/multiview/cloud_neutral.ply"
    neutral_surface = _TAKE + "/multiview/surface_neutral.ply"
    neutral_overlay = _TAKE + "/multiview/overlay/neutral.png"
    anchor = _TAKE + "/multiview/anchors/{clip}.npz"
    clip = _TAKE + "/multiview/clips/{clip}.npz"
    track = _TAKE + "/multiview/track.npz"
    accurate = _TAKE + "/multiview/H/{chunk}.npy"
    accurate_topology = _TAKE + "/multiview/H/topology.ply"
    visibility = _TAKE + "/multiview/visibility/{chunk}.npy"
    multiview_quality = _TAKE + "/multiview/quality/{chunk}.tsv"
    multiview_overlay = _TAKE + "/multiview/overlay/{chunk}.png"
    drift = _TAKE + "/multiview/drift/{chunk}.tsv"
    drift_table = _TAKE + "/multiview/drift.tsv"
    multiview_page = _TAKE + "/multiview/report.html"

    # inpaint
    plain_texture = _SUBJECT + "/plain_texture.exr"
    plain_texture_overlay = _SUBJECT + "/overlay/plain_texture.png"
    tattoo_reference = _TAKE + "/inpaint/reference.exr"
    tattoo_reference_overlay = _TAKE + "/inpaint/overlay/reference.png"
    inpainted = _TAKE + "/inpaint/{chunk}"
    inpaint_quality = _TAKE + "/inpaint/quality/{chunk}.tsv"
    inpaint_overlay = _TAKE + "/inpaint/overlay/{chunk}.png"

    # scan: a person's own tracker model
    own_tracker = _SUBJECT + "/tracker.npz"
    scan_landmarks = _SUBJECT + "/scan/landmarks.tsv"
    scan_quality = _SUBJECT + "/scan/quality/scan.tsv"
    scan_overlay = _SUBJECT + "/scan/overlay/scan.png"

    # export: a person's own head as the mesh of the files
    head_binding = _SUBJECT + "/head/binding.npz"
    head_labels = _SUBJECT + "/head/labels.npz"
    head_landmarks = _SUBJECT + "/head/landmarks.tsv"
    head_overlay = _SUBJECT + "/head/head.png"

    # tracking: C
    identity = _SUBJECT + "/identity.npz"
    identity_overlay = _SUBJECT + "/overlay/identity.png"
    fit = _TAKE + "/tracking/fit.npz"
    landmark_fit = _TAKE + "/tracking/landmark_fit.npz"
    appearance = _TAKE + "/tracking/appearance.npz"
    appearance_overlay = _TAKE + "/tracking/appearance.png"
    image_fit = _TAKE + "/tracking/image_fit/{chunk}.npz"
    offsets = _TAKE + "/tracking/offsets/{chunk}.npy"
    coarse = _TAKE + "/tracking/C/{chunk}.npy"
    coarse_topology = _TAKE + "/tracking/C/topology.ply"
    tracking_quality = _TAKE + "/tracking/quality/{chunk}.tsv"
    tracking_overlay = _TAKE + "/tracking/overlay/{chunk}.png"
    residuals = _TAKE + "/tracking/residuals/{step}/{chunk}.tsv"
    residuals_overlay = _TAKE + "/tracking/residuals/overlay/{chunk}.png"

    # tracking: another tracker's sequence as the base
    sequence = _TAKE + "/tracking/sequence.npz"
    external_model = R + "/face_model/external.npz"
    external_topology = R + "/face_model/external/topology.npz"
    external_landmarks = R + "/face_model/external/landmarks.tsv"
    external_overlay = R + "/face_model/external/overlay.png"
    placement = _TAKE + "/tracking/placement.npz"

    # detail
    flow = _TAKE + "/detail/flow/{chunk}.npy"
    flow_quality = _TAKE + "/detail/quality/{chunk}.tsv"
    flow_overlay = _TAKE + "/detail/overlay/{chunk}.png"
    relief_start = _TAKE + "/detail/relief/light_start.npz"
    relief_evidence = _TAKE + "/detail/relief/light/{chunk}.npz"
    relief_light = _TAKE + "/detail/relief/light.npz"
    relief_topology = _TAKE + "/detail/relief/topology.obj"
    relief = _TAKE + "/detail/relief/frames/{chunk}.npz"
    relief_meshes = _TAKE + "/detail/relief/{chunk}.npy"
    normal_maps = _TAKE + "/detail/relief/normals/{chunk}"
    displacement_maps = _TAKE + "/detail/relief/displacements/{chunk}"
    relief_quality = _TAKE + "/detail/relief/quality/{chunk}.tsv"
    relief_overlay = _TAKE + "/detail/relief/overlay/{chunk}.png"

    # contours
    contour_detector = _TAKE + "/contours/detector.npz"
    label_quality = _TAKE + "/contours/quality/labels.tsv"
    maps = _TAKE + "/contours/{chunk}"
    contours_quality = _TAKE + "/contours/quality/{chunk}.tsv"
    contours_overlay = _TAKE + "/contours/overlay/{chunk}.png"

    # correspondence
    correspondence = _SUBJECT + "/correspondence.npz"
    correspondence_quality = _SUBJECT + "/correspondence/quality/neutral.tsv"
    correspondence_overlay = _SUBJECT + "/correspondence/overlay/neutral.png"

    # features
    features = _TAKE + "/features/{chunk}.npz"
    features_quality = _TAKE + "/features/quality/{chunk}.tsv"
    features_overlay = _TAKE + "/features/overlay/{chunk}.png"

    # correction
    layers = _TAKE + "/correction/layers/{chunk}.npz"
    correction_quality = _TAKE + "/correction/quality/{chunk}.tsv"
    correction_overlay = _TAKE + "/correction/overlay/{chunk}.png"
    neutral_pair = _TAKE + "/correction/neutral_pair.npz"
    neutral_pair_overlay = _TAKE + "/correction/overlay/neutral_pair.png"

    # database, training
    database = R + "/database/lips.h5"
    generic_database = R + "/database/generic.h5"
    model = R + "/models/{regressor}.h5"
    validation_table = R + "/models/{regressor}.cv.tsv"
    validation_curve = R + "/models/{regressor}.cv.png"

    # evaluation
    evaluated = _EVALUATION + "/takes/{subject}/{take}"
    reconstructed = _EVALUATION + "/reconstruction/{subject}/{take}"
    lip_shapes = _EVALUATION + "/lip_shapes.npz"
    measures = _EVALUATION + "/measures.tsv"
    kinds = _EVALUATION + "/kinds.tsv"
    seconds = _EVALUATION + "/seconds.tsv"
    comparisons = _EVALUATION + "/comparisons.tsv"
    headline = _EVALUATION + "/headline.tsv"
    table1 = _EVALUATION + "/table1.tsv"
    table1_figure = _EVALUATION + "/table1.png"
    table2 = _EVALUATION + "/table2.tsv"
    table3 = _EVALUATION + "/table3.tsv"
    estimators = _EVALUATION + "/estimators.tsv"
    figure16 = _EVALUATION + "/figure16.png"
    ablations = _EVALUATION + "/ablations.tsv"
    guided_measures = _EVALUATION + "/guided/{subject}/{take}/measures.tsv"
    guided_figure = _EVALUATION + "/guided/{subject}/{take}/figure11.png"
    guided_sheet = _EVALUATION + "/guided/{subject}/{take}/figure12.png"

    # apply
    applied = _APPLY
    corrected = _APPLY + "/chunks/{chunk}.npy"
    apply_clip = _APPLY + "/chunks/{chunk}.mp4"
    apply_quality = _APPLY + "/quality/{chunk}.tsv"
    apply_overlay = _APPLY + "/overlay.mp4"
    timeline = _APPLY + "/timeline.png"
    lips_page = _APPLY + "/lips.html"
    makeup = _APPLY + "/makeup.mp4"
    makeup_chunk = _APPLY + "/makeup/{chunk}"

    # guided
    guided = _TAKE + "/guided"
    refined = _TAKE + "/guided/refined/{frame}.npz"
    refined_quality = _TAKE + "/guided/quality/refined/{frame}.tsv"
    refined_overlay = _TAKE + "/guided/overlay/refined/{frame}.png"
    lip_propagator = _TAKE + "/guided/propagator.npz"
    suggestions = _TAKE + "/guided/suggestions.tsv"
    guided_chunk = _TAKE + "/guided/chunks/{chunk}.npy"
    guided_clip = _TAKE + "/guided/chunks/{chunk}.mp4"
    guided_quality = _TAKE + "/guided/quality/{chunk}.tsv"
    guided_chunk_overlay = _TAKE + "/guided/overlay/{chunk}.png"
    guided_overlay = _TAKE + "/guided/overlay.mp4"
    guided_timeline = _TAKE + "/guided/timeline.png"

    # report
    quality = R + "/quality.tsv"
    summary = _EVALUATION + "/summary.html"

    #: What `make clean-intermediate` removes: large, read by the next stages only, and no page or export shows it.
    intermediate = (inpainted, maps, faces, anchor, clip, image_fit, apply_clip, guided_clip)

    @staticmethod
    def log(rule, job):
        """Log of a job: `job` says what it is done for ("run", "subject", "take", "chunk", ...)."""
        return f"{R}/logs/{rule}{_JOBS[job]}.log"

    @staticmethod
    def benchmark(rule, job):
        """Time and memory of a job; see `log`."""
        return f"{R}/benchmarks/{rule}{_JOBS[job]}.tsv"
