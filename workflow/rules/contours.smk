"""Lip contours (Lips16 3.2.2): detectors of an illumination, likelihood maps of every frame."""

from vermilion.contours.labels import label_paths


def contour_labels(wildcards):
    """Contours drawn on frames of the take's monocular camera."""
    take = take_of(wildcards)
    if take.source == STUDIO:
        folder = f"{R}/captures/{take.name}/labels/contours"
        return [
            f"{folder}/{camera}/{frame:06d}.json" for camera, frame in studio_contour_labels(take)
        ]
    labels = label_paths(take.source, mono_camera(wildcards))
    return [str(path) for frame, path in labels.items() if take.first <= frame <= take.last]


def tracked_lips(wildcards):
    """The track of a take whose contours start from it, or whose labels are held against it.

    Of the job's chunk, or of all.
    """
    if CONFIG.contours.detector.kind in ("boosted", "landmarks"):
        return {}
    subject, take = wildcards.subject, wildcards.take
    parts = [wildcards.chunk] if "chunk" in wildcards.keys() else chunks(subject, take)
    folder = f"{R}/takes/{subject}/{take}/tracking"
    return {
        "tracker": tracker_of(wildcards),
        "fit": f"{folder}/fit.npz",
        "coarse": [f"{folder}/C/{chunk}.npy" for chunk in parts],
    }


rule contour_detector:
    """Trains the inner and outer contour detectors of a take: contours/detector.npz, quality of labels."""
    input:
        unpack(tracked_lips),
        images=mono_images,
        landmarks=per_chunk(R + "/takes/{subject}/{take}/landmarks/{chunk}.npz"),
        labels=contour_labels,
    output:
        detector=R + "/takes/{subject}/{take}/contours/detector.npz",
        quality=R + "/takes/{subject}/{take}/contours/quality/labels.tsv",
    log:
        R + "/logs/contour_detector/{subject}-{take}.log",
    benchmark:
        R + "/benchmarks/contour_detector/{subject}-{take}.tsv"
    resources:
        mem_mb=1500,
        runtime=30,
    params:
        cfg=cfg_of("contours.detector"),
        code=code_of("contours/contour_detector"),
        source=mono_sources,
        capture=source_of,
        camera=mono_camera,
    script:
        "../scripts/contours/contour_detector.py"


rule contours:
    """Draws the likelihood maps of a chunk: contours/{chunk}/<frame>.exr, inner and outer."""
    input:
        unpack(mono_inputs),
        unpack(tracked_lips),
        landmarks=R + "/takes/{subject}/{take}/landmarks/{chunk}.npz",
        detector=R + "/takes/{subject}/{take}/contours/detector.npz",
    output:
        maps=directory(R + "/takes/{subject}/{take}/contours/{chunk}"),
        quality=R + "/takes/{subject}/{take}/contours/quality/{chunk}.tsv",
        overlay=R + "/takes/{subject}/{take}/contours/overlay/{chunk}.png",
    log:
        R + "/logs/contours/{subject}-{take}-{chunk}.log",
    benchmark:
        R + "/benchmarks/contours/{subject}-{take}-{chunk}.tsv"
    resources:
        mem_mb=1000,
        runtime=60,
    params:
        cfg=cfg_of("contours.maps"),
        code=code_of("contours/contours"),
        source=mono_source,
        capture=source_of,
        camera=mono_camera,
    script:
        "../scripts/contours/contours.py"
