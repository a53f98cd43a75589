"""Landmarks of every frame (Mono13 5): by networks, by a trained regressor, or from files.

With `landmarks.correction.mode: flow` these are landmarks/raw/{chunk}.npz; key frames are chosen
among them (landmarks/key_frames.npz), and between these flow corrects (landmarks/{chunk}.npz).
"""

from vermilion.storage.errors import InputError
from vermilion.imaging.source import is_video
from vermilion.landmarks.around import frames_around_take
from vermilion.landmarks.choose import usable_kind
from vermilion.landmarks.labels import label_files
from vermilion.landmarks.networks import FACE_FILE, LANDMARK_FILE

DETECTED = P.landmarks_folder + ("" if CONFIG.landmarks.correction.mode == "raw" else "/raw")

#: The kind of detector that runs: the configured one, or what takes its place on this machine.
try:
    DETECTOR, _INSTEAD = usable_kind(
        CONFIG.landmarks.detector,
        CONFIG.landmarks.mediapipe.environment,
        CONFIG.landmarks.models,
        bool(CONFIG.landmarks.training_takes),
    )
except InputError as error:
    raise WorkflowError(str(error)) from None
if _INSTEAD and IS_MAIN_PROCESS:
    print(_INSTEAD, file=sys.stderr)


def dense_landmarks():
    """Whether the landmarks of a take have dense lips: flow corrects the 66 points alone."""
    files = CONFIG.landmarks.files.set if DETECTOR == "files" else ""
    dense = DETECTOR == "mediapipe" or files == "mediapipe478"
    return dense and CONFIG.landmarks.correction.mode == "raw"


def detector_cfg(*more):
    """Keys of the configuration that a rule with a detector reads."""
    return {
        **cfg_of("landmarks.detector", "landmarks.networks", *more),
        "landmarks.detector": DETECTOR,
    }


def detector_files(wildcards):
    """What the detector reads: its model or networks; nothing for files and mediapipe."""
    folder = Path(CONFIG.landmarks.models)
    if DETECTOR == "onnx":
        return [str(folder / FACE_FILE), str(folder / LANDMARK_FILE)]
    return [P.landmark_model] if DETECTOR == "trained" else []


def detector_path(wildcards):
    """The environment, the folder of networks or the file of the regressor."""
    paths = {"mediapipe": CONFIG.landmarks.mediapipe.environment, "onnx": CONFIG.landmarks.models}
    return paths.get(DETECTOR, P.landmark_model)


def landmark_file(wildcards, camera):
    """The file of another tracker that holds a take's landmarks in one camera."""
    return CONFIG.landmarks.files.path.format(
        subject=wildcards.subject, take=wildcards.take, camera=camera
    )


def landmark_file_input(wildcards):
    if DETECTOR != "files":
        return []
    return landmark_file(wildcards, mono_camera(wildcards))


def training_takes():
    """Rows of the takes with labelled landmarks."""
    wanted = CONFIG.landmarks.training_takes
    if not wanted:
        raise WorkflowError(
            f"{ORIGIN}, key landmarks.training_takes: found none; expected takes with clicked landmarks, "
            f"written subject/take, as landmarks.detector is `trained`. Name some of {CONFIG.takes}, or set "
            "landmarks.detector: `mediapipe` is for real faces."
        )
    return [take for take in TAKES if take.name in wanted]


def landmark_label_files(take):
    """Landmark labels of a take: those on disk, or those that the studio will write."""
    if take.source == STUDIO:
        return [path for path in studio_label_files(take) if "/labels/landmarks/" in path]
    return [str(path) for path in label_files(take.source)]


def landmark_model_inputs(wildcards):
    """Checked frames of the training takes, and their labels."""
    inputs = []
    for take in training_takes():
        inputs += captured_take(take) + landmark_label_files(take)
    return inputs


rule landmark_model:
    """Trains the landmark regressor on labelled frames of other takes: landmarks/model.npz."""
    input:
        landmark_model_inputs,
    output:
        multiext(P.landmark_models, model="model.npz", overlay="overlay.png"),
    log:
        P.log("landmark_model", "run"),
    cache: True
    resources:
        mem_mb=growing(2500),
        runtime=growing(60),
    params:
        cfg=cfg_of("landmarks.training"),
        code=code_of("landmarks/landmark_model"),
        wc=wildcards_of,
        roles=roles_of,
        takes=lambda wildcards: [
            {"subject": t.subject, "take": t.take, "source": source_of(t)}
            for t in training_takes()
        ],
    script:
        "../scripts/landmarks/landmark_model.py"


def given_landmark_labels(wildcards):
    """Landmarks that a person marked on frames of the take's monocular camera."""
    take, camera = take_of(wildcards), mono_camera(wildcards)
    paths = [Path(path) for path in landmark_label_files(take)]
    return [
        str(path)
        for path in paths
        if path.parent.name == camera and take.first <= int(path.stem) <= take.last
    ]


def key_frame_file(wildcards):
    """The file of another tracker whose landmarks count as key frames, where there is one."""
    path = CONFIG.landmarks.key_frames.files.path.format(
        subject=wildcards.subject, take=wildcards.take, camera=mono_camera(wildcards)
    )
    return [path] if path and Path(path).is_file() else []


rule landmarks_faces:
    """Finds all faces in a chunk of the monocular images, each by itself: landmarks/faces/{chunk}.npz."""
    input:
        images=chunk_images,
        detector=detector_files,
        files=landmark_file_input,
    output:
        faces=P.faces,
    log:
        P.log("landmarks_faces", "chunk"),
    benchmark:
        P.benchmark("landmarks_faces", "chunk")
    resources:
        mem_mb=growing(1000, for_mono=60),
        runtime=growing(60),
    params:
        cfg=detector_cfg("landmarks.files"),
        code=code_of("landmarks/landmarks_faces"),
        source=chunk_source,
        camera=mono_camera,
        frames=chunk_frames,
        model=detector_path,
    script:
        "../scripts/landmarks/landmarks_faces.py"


def followed_face(wildcards):
    """Which face of a take is followed: what the take sheet says, else the configuration."""
    return list(take_of(wildcards).face) or CONFIG.landmarks.following.face


rule landmarks_followed:
    """Finds the cuts of a take, chooses one face and follows it: landmarks/followed.npz and .tsv."""
    input:
        faces=per_chunk(P.faces),
    output:
        followed=P.followed,
        table=P.followed_table,
    log:
        P.log("landmarks_followed", "take"),
    benchmark:
        P.benchmark("landmarks_followed", "take")
    resources:
        mem_mb=growing(800, for_each_frame=0.05),
        runtime=growing(10),
    params:
        cfg=cfg_of("landmarks.following"),
        code=code_of("landmarks/landmarks_followed"),
        face=followed_face,
        one_shot=lambda wildcards: take_of(wildcards).is_multiview,
    script:
        "../scripts/landmarks/landmarks_followed.py"


rule landmarks:
    """Writes the landmarks of the followed face in a chunk, with quality rows and an overlay."""
    input:
        images=chunk_images,
        faces=P.faces,
        followed=P.followed,
    output:
        landmarks=DETECTED + "/{chunk}.npz",
        quality=DETECTED + "/quality/{chunk}.tsv",
        overlay=DETECTED + "/overlay/{chunk}.png",
    log:
        P.log("landmarks", "chunk"),
    benchmark:
        P.benchmark("landmarks", "chunk")
    resources:
        mem_mb=growing(1000, for_mono=70),
        runtime=growing(30),
    params:
        code=code_of("landmarks/landmarks"),
        source=chunk_source,
        camera=mono_camera,
    script:
        "../scripts/landmarks/landmarks.py"


def source_frames(wildcards):
    """First and last frame of a take's images; nothing of a video file, which the job opens."""
    source = take_of(wildcards).source
    files = {} if is_video(source) else capture_files(source)
    return [min(files), max(files)] if files else []


def files_around(wildcards):
    """Files of the frames around a short take that may tell its lips, too; none where there are none."""
    take, options = take_of(wildcards), CONFIG.contours.detector.track
    if take.source == STUDIO or take.role == "tattoo":
        return []
    if is_video(take.source):
        return [take.source] if take.last - take.first + 1 < options.span else []
    files, ends = capture_files(take.source), source_frames(wildcards)
    frames = frames_around_take(
        (take.first, take.last), ends or (0, 0), options.span, options.frames
    )
    return [path for frame in frames for path in files.get(frame, [])]


rule landmarks_around:
    """Finds the followed face in frames of the source around a short take: landmarks/around.npz."""
    input:
        source=files_around,
        faces=per_chunk(P.faces),
        followed=P.followed,
        detector=detector_files,
        files=landmark_file_input,
    output:
        landmarks=P.landmarks_around,
    log:
        P.log("landmarks_around", "take"),
    benchmark:
        P.benchmark("landmarks_around", "take")
    resources:
        mem_mb=growing(1000, for_mono=60),
        runtime=growing(30),
    params:
        cfg=detector_cfg(
            "landmarks.files",
            "landmarks.following",
            "contours.detector.track.frames",
            "contours.detector.track.span",
        ),
        code=code_of("landmarks/landmarks_around"),
        source=source_of,
        source_frames=source_frames,
        camera=mono_camera,
        frames=take_span,
        face=followed_face,
        model=detector_path,
    script:
        "../scripts/landmarks/landmarks_around.py"


if CONFIG.landmarks.correction.mode == "flow":

    rule landmarks_key_frames:
        """Chooses the key frames of a take by local binary patterns (Mono13 5.2)."""
        input:
            images=mono_images,
            landmarks=per_chunk(DETECTED + "/{chunk}.npz"),
            labels=given_landmark_labels,
            files=key_frame_file,
        output:
            key_frames=P.key_frames,
            table=P.key_frames_table,
        log:
            P.log("landmarks_key_frames", "take"),
        benchmark:
            P.benchmark("landmarks_key_frames", "take")
        resources:
            mem_mb=growing(1000),
            runtime=growing(60),
        params:
            cfg=cfg_of("landmarks.key_frames", "landmarks.correction"),
            code=code_of("landmarks/landmarks_key_frames"),
            source=mono_source,
            camera=mono_camera,
        script:
            "../scripts/landmarks/landmarks_key_frames.py"

    rule landmarks_corrected:
        """Corrects the landmarks of a chunk by flow between key frames (Mono13 5.3)."""
        input:
            images=mono_images,
            landmarks=per_chunk(DETECTED + "/{chunk}.npz"),
            key_frames=P.key_frames,
        output:
            landmarks=P.landmarks,
            quality=P.landmarks_folder + "/quality/{chunk}.tsv",
            overlay=P.landmarks_folder + "/overlay/{chunk}.png",
        log:
            P.log("landmarks_corrected", "chunk"),
        benchmark:
            P.benchmark("landmarks_corrected", "chunk")
        resources:
            mem_mb=growing(1000),
            runtime=growing(20, for_each_frame=0.2),
        params:
            cfg=cfg_of("landmarks.correction"),
            code=code_of("landmarks/landmarks_corrected"),
            source=mono_source,
            camera=mono_camera,
            frames=chunk_frames,
        script:
            "../scripts/landmarks/landmarks_corrected.py"


rule landmarks_views:
    """Finds the landmarks of the neutral in every camera of a rig: views_neutral.npz."""
    input:
        manifest=captured_neutral,
        cameras=P.cameras,
        detector=detector_files,
    output:
        views=P.views_neutral,
        overlay=P.views_overlay,
    log:
        P.log("landmarks_views", "take"),
    benchmark:
        P.benchmark("landmarks_views", "take")
    resources:
        mem_mb=growing(1000, for_rig=25),
        runtime=growing(30, for_rig_frames=0.003),
    params:
        cfg=detector_cfg("landmarks.files"),
        code=code_of("landmarks/landmarks_views"),
        source=source_of,
        frame=first_frame,
        model=detector_path,
        files=lambda wildcards: landmark_file(wildcards, "{camera}"),
    script:
        "../scripts/landmarks/landmarks_views.py"
