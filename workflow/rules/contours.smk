"""Lip contours (Lips16 3.2.2): detectors of an illumination, likelihood maps of every frame."""

from vermilion.contours.labels import label_paths


def contour_labels(wildcards):
    """Contours drawn on frames of the take's monocular camera."""
    take = take_of(wildcards)
    if take.source == STUDIO:
        return [path for path in studio_label_files(take) if "/labels/contours/" in path]
    labels = label_paths(take.source, mono_camera(wildcards))
    return [str(path) for frame, path in labels.items() if take.first <= frame <= take.last]


def tracked_lips(wildcards):
    """The track of a take whose contours start from it, or whose labels are held against it.

    Of the job's chunk, or of all. Lips of dense landmarks serve better.
    """
    if CONFIG.contours.detector.kind in ("boosted", "landmarks") or dense_landmarks():
        return {}
    parts = [wildcards.chunk] if "chunk" in wildcards.keys() else chunks(wildcards)
    return {
        "tracker": tracker_of(wildcards),
        "fit": fill(P.fit, wildcards),
        "coarse": [fill(P.coarse, wildcards, chunk=chunk) for chunk in parts],
    }


def lips_around(wildcards):
    """Landmarks around a short take without labels, which help to learn what its lips look like."""
    by_track = CONFIG.contours.detector.kind in ("auto", "track") and dense_landmarks()
    labels = CONFIG.contours.detector.kind == "auto" and contour_labels(wildcards)
    if not by_track or labels or not files_around(wildcards):
        return []
    return fill(P.landmarks_around, wildcards)


rule contour_detector:
    """Trains the inner and outer contour detectors of a take: contours/detector.npz, quality of labels."""
    input:
        unpack(tracked_lips),
        images=mono_images,
        landmarks=per_chunk(P.landmarks),
        around=lips_around,
        labels=contour_labels,
    output:
        detector=P.contour_detector,
        quality=P.label_quality,
    log:
        P.log("contour_detector", "take"),
    benchmark:
        P.benchmark("contour_detector", "take")
    resources:
        mem_mb=growing(1500, for_mono=210),
        runtime=growing(30),
    params:
        cfg=cfg_of("contours.detector"),
        code=code_of("contours/contour_detector"),
        source=mono_source,
        capture=source_of,
        camera=mono_camera,
    script:
        "../scripts/contours/contour_detector.py"


rule contours:
    """Draws the likelihood maps of a chunk: contours/{chunk}/<frame>.exr, inner and outer."""
    input:
        unpack(tracked_lips),
        images=chunk_images,
        labels=lambda wildcards: in_bucket(lambda: contour_labels(wildcards)),
        landmarks=P.landmarks,
        detector=P.contour_detector,
    output:
        maps=directory(P.maps),
        quality=P.contours_quality,
        overlay=P.contours_overlay,
    log:
        P.log("contours", "chunk"),
    benchmark:
        P.benchmark("contours", "chunk")
    resources:
        mem_mb=growing(1000, for_mono=60),
        runtime=growing(60),
    params:
        cfg=cfg_of("contours.maps"),
        code=code_of("contours/contours"),
        source=chunk_source,
        capture=source_of,
        camera=mono_camera,
    script:
        "../scripts/contours/contours.py"
