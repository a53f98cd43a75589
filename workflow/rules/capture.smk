"""Captures as they come (Lips16 3.1): checked images and calibrated cameras of every take."""

from functools import cache

from vermilion.imaging.frames import list_frames
from vermilion.capture.camera_files.read import camera_files as given_camera_files
from vermilion.imaging.source import IMAGE_SUFFIXES, folder_of, is_video


@cache
def capture_files(source):
    """Frame -> images of that frame, of a capture folder, a folder of frames, or a single image."""
    rig = Path(source) / "frames"
    folders = sorted(rig.glob("*/")) if rig.is_dir() else [Path(source)]
    files = {}
    for folder in folders:
        for frame, path in list_frames(folder).items():
            files.setdefault(frame, []).append(str(path))
    return files


def camera_files(source):
    """The calibration that a capture brings: a COLMAP model, or images of a board."""
    if folder_of(source, "cameras").is_dir():
        return [str(path) for path in given_camera_files(folder_of(source, "cameras"))]
    views = folder_of(source, "calibration").glob("*/*")
    return sorted(str(path) for path in views if path.suffix.lower() in IMAGE_SUFFIXES)


def capture_inputs(wildcards):
    """Images of a chunk that exist, and the calibration; a missing image is the job's to name."""
    take = take_of(wildcards)
    if take.source == STUDIO:
        return studio_frames(wildcards, chunk_frames(wildcards)) + camera_inputs(wildcards)
    if is_video(take.source):
        return [take.source]
    files = capture_files(take.source)
    images = [path for frame in frames_in(wildcards.chunk) for path in files.get(frame, [])]
    return images + camera_files(take.source)


def camera_inputs(wildcards):
    """The calibration of a take: its files, or what the studio writes beside its images."""
    take = take_of(wildcards)
    if take.source == STUDIO:
        known = take.is_multiview or CONFIG.studio.video_calibration
        return studio_cameras(wildcards) if known else []
    return camera_files(take.source)


def facts_of_video(wildcards):
    """The facts of a take's video file, which are found once; nothing for images."""
    return fill(P.video_facts, wildcards) if is_video(take_of(wildcards).source) else []


def rate_to_compare(wildcards):
    """The sheet's rate in the first chunk of a take, where the file's is held against it."""
    take = take_of(wildcards)
    return take.fps if frames_in(wildcards.chunk)[0] == take.first else None


rule video_facts:
    """Hashes a video file and lists its frames, once a take: capture/video.json."""
    input:
        lambda wildcards: take_of(wildcards).source,
    output:
        P.video_facts,
    log:
        P.log("video_facts", "take"),
    benchmark:
        P.benchmark("video_facts", "take")
    resources:
        mem_mb=growing(800),
        runtime=growing(30),
    params:
        code=code_of("capture/video_facts"),
    script:
        "../scripts/capture/video_facts.py"


rule capture:
    """Checks every image of a chunk whole: capture/{chunk}.json, quality rows, contact sheet."""
    input:
        files=capture_inputs,
        video=facts_of_video,
    output:
        manifest=P.manifest,
        quality=P.capture_quality,
        overlay=P.capture_overlay,
    log:
        P.log("capture", "chunk"),
    benchmark:
        P.benchmark("capture", "chunk")
    resources:
        mem_mb=growing(800, for_rig=25),
        runtime=growing(60, for_rig_frames=0.005),
    params:
        cfg=cfg_of("capture.manifest"),
        code=code_of("capture/capture"),
        source=source_of,
        camera=mono_camera,
        multiview=lambda wildcards: take_of(wildcards).is_multiview,
        frames=chunk_frames,
        fps=rate_to_compare,
    script:
        "../scripts/capture/capture.py"


rule cameras:
    """Reads, calibrates or assumes a take's cameras, refines them: cameras/ (COLMAP text), cameras.json."""
    input:
        calibration=camera_inputs,
        manifests=per_chunk(P.manifest),
        images=lambda wildcards: in_bucket(lambda: captured_take(wildcards)),
    output:
        cameras=directory(P.cameras),
        summary=P.calibration,
        overlay=P.cameras_overlay,
    log:
        P.log("cameras", "take"),
    benchmark:
        P.benchmark("cameras", "take")
    resources:
        mem_mb=growing(1500, for_rig=90),
        runtime=growing(60, for_rig=0.3),
    params:
        cfg=cfg_of("capture.calibration", "capture.refinement"),
        code=code_of("capture/cameras"),
        camera=mono_camera,
        frames=take_span,
        focal=lambda wildcards: take_of(wildcards).focal,
    script:
        "../scripts/capture/cameras.py"
