"""Synthetic captures (embedded default): capture folders as a real rig gives, their truth apart.

A chunk's images are named one by one, so that a lost or damaged one is made again. As Snakemake
wants to know the names of outputs beforehand, there is one rule a take and chunk, and `take` and
`chunk` are read here, not from wildcards.
"""

from vermilion.config.studio import StudioSubject
from vermilion.studio.label_frames import label_frames
from vermilion.studio.rig import FRONTAL_PAIR, camera_names

STUDIO_PLAN_KEYS = (
    "identity_spread",
    "expression_spread",
    "seed",
    "slight_open",
    "ease_in_frames",
    "intensity",
    "head_turn_deg",
    "head_shift_mm",
)
STUDIO_CAMERA_KEYS = (
    "cameras",
    "camera_distance_mm",
    "face_size_px",
    "lip_size_px",
    "video_size_px",
    "face_view_mm",
    "lip_view_mm",
    "video_view_mm",
)
#: Those that a take may have of its own.
STUDIO_OWN_CAMERA_KEYS = ("camera_distance_mm", "video_view_mm", "video_size_px")
STUDIO_OWN_MOTION_KEYS = ("head_turn_deg", "head_shift_mm")
STUDIO_IMAGE_KEYS = (
    "occlusion_directions",
    "light_samples",
    "edge_samples",
    "noise_read",
    "noise_shot",
)


def studio_values(keys):
    """Values of these keys of the studio's section."""
    return {key: plain_value(f"studio.{key}") for key in keys}


def studio_performance(take):
    """How the take is performed: its section of the configuration, or the defaults."""
    return CONFIG.studio.take_of(take.subject, take.take)


def studio_plan(take):
    """All that the actor, the curves and the light of a take depend on."""
    subject = CONFIG.studio.subjects.get(take.subject, StudioSubject())
    return {
        "role": take.role,
        "first": take.first,
        "last": take.last,
        "fps": take.fps,
        "actor": {"seed": subject.seed, "identity": subject.identity},
        "performance": studio_performance(take).model_dump(
            mode="json", exclude={*STUDIO_OWN_CAMERA_KEYS, *STUDIO_OWN_MOTION_KEYS}
        ),
        **studio_values(STUDIO_PLAN_KEYS),
        **studio_own(take, STUDIO_OWN_MOTION_KEYS),
    }


def studio_own(take, keys):
    """Values that a take has of its own, of these keys of its section."""
    own = studio_performance(take).model_dump(mode="json", include=set(keys))
    return {key: value for key, value in own.items() if value is not None}


def studio_camera_values(take):
    """Where the cameras of a take stand and what they see."""
    return studio_values(STUDIO_CAMERA_KEYS) | studio_own(take, STUDIO_OWN_CAMERA_KEYS)


def studio_csv(take):
    """The recorded curves of a `live_link` take."""
    performance = studio_performance(take)
    return [performance.csv] if performance.performance == "live_link" else []


def studio_contour_labels(take):
    """[camera, frame] of the contours that a person would draw."""
    if take.role == "plain" or studio_performance(take).performance == "people":
        return []
    camera = (
        FRONTAL_PAIR[0] if take.is_multiview else camera_names(take.role, CONFIG.studio.cameras)[0]
    )
    frames = label_frames(take.first, take.last, CONFIG.studio.contour_labels)
    return [[camera, frame] for frame in frames]


def studio_landmark_labels(take):
    """[camera, frame] of the landmarks that a person would mark: the neutral, seen by the frontal
    pair; every frame of a `people` take."""
    cameras = FRONTAL_PAIR if take.is_multiview else camera_names(take.role, CONFIG.studio.cameras)
    people = studio_performance(take).performance == "people"
    frames = take.frames if people else [take.first]
    return [[camera, frame] for camera in cameras for frame in frames]


def studio_label_files(take):
    """Label files of a take, in the order of the two lists above."""
    labels = fill(P.capture_folder, take) + "/labels"
    return [
        f"{labels}/{kind}/{camera}/{frame:06d}.json"
        for kind, pairs in (
            ("contours", studio_contour_labels(take)),
            ("landmarks", studio_landmark_labels(take)),
        )
        for camera, frame in pairs
    ]


def studio_cameras(take):
    """Camera files of a studio take; those of a video without calibration lie with its truth."""
    hidden = not (take_of(take).is_multiview or CONFIG.studio.video_calibration)
    folder = fill(P.truth if hidden else P.capture_folder, take) + "/cameras"
    return [f"{folder}/{name}.txt" for name in ("cameras", "images", "points3D")]


def studio_outputs():
    """Every image, camera and label of the studio's takes; the truth comes with them."""
    paths = []
    for take in [take for take in TAKES if take.source == STUDIO]:
        for chunk in chunks(take):
            paths += studio_frames(take, frames_in(chunk))
        paths += studio_cameras(take) + studio_label_files(take)
    return paths


def studio_frames(take, frames):
    """Images of some frames of a studio take."""
    folder = fill(P.capture_folder, take) + "/frames"
    return [
        f"{folder}/{camera}/{frame:06d}.png"
        for camera in camera_names(take_of(take).role, CONFIG.studio.cameras)
        for frame in frames
    ]


def studio_images(take, frames):
    """Images of some frames of a take of the studio; none of another take."""
    return studio_frames(take, frames) if take_of(take).source == STUDIO else []


for take in [take for take in TAKES if take.source == STUDIO]:

    rule:
        # The cameras, labels and truth of one take.
        name:
            f"studio_rig_{take.subject}_{take.take}"
        input:
            model=P.studio_model,
            csv=studio_csv(take),
        output:
            cameras=studio_cameras(take),
            labels=studio_label_files(take),
            truth=multiext(
                fill(P.truth, take) + "/",
                "vertices_mm.npy",
                "triangles.npy",
                "neutral_mm.npy",
                "weights.json",
            ),
        log:
            fill(P.log("studio_rig", "take"), take),
        benchmark:
            fill(P.benchmark("studio_rig", "take"), take)
        resources:
            mem_mb=growing(1500 + len(take.frames) + 140 * sum(megapixels_of(take))),
            runtime=growing(30),
        params:
            cfg={
                "plan": studio_plan(take),
                "cameras": studio_camera_values(take),
                "contours": studio_contour_labels(take),
                "landmarks": studio_landmark_labels(take),
            },
            code=code_of("studio/studio_rig"),
            capture=fill(P.capture_folder, take),
        script:
            "../scripts/studio/studio_rig.py"

    for chunk in chunks(take):

        rule:
            # The images of one chunk of a take, from all cameras.
            name:
                f"studio_take_{take.subject}_{take.take}_{chunk.replace('-', '_')}"
            input:
                model=P.studio_model,
                csv=studio_csv(take),
                cameras=studio_cameras(take),
            output:
                studio_frames(take, frames_in(chunk)),
            log:
                fill(P.log("studio_take", "chunk"), take, chunk=chunk),
            benchmark:
                fill(P.benchmark("studio_take", "chunk"), take, chunk=chunk)
            resources:
                mem_mb=growing(1500 + 140 * sum(megapixels_of(take))),
                runtime=growing(5 + len(frames_in(chunk)) * (1 + sum(megapixels_of(take)) / 10)),
            params:
                cfg={
                    "plan": studio_plan(take),
                    "images": studio_values(STUDIO_IMAGE_KEYS),
                    "name": take.name,
                    "frames": frames_in(chunk),
                },
                code=code_of("studio/studio_take"),
                capture=fill(P.capture_folder, take),
            script:
                "../scripts/studio/studio_take.py"
