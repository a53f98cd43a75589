"""The followed face in frames of a take's source before and after it."""

from vermilion.imaging.frames import open_frames
from vermilion.imaging.source import source_path
from vermilion.landmarks.around import frames_around_take, track_around
from vermilion.landmarks.choose import face_finder
from vermilion.landmarks.faces import SeenFaces, find_faces
from vermilion.landmarks.following import FaceChoice, FollowedFace
from vermilion.provenance.begun_run import begin_job


def main(snakemake):
    cfg, params = snakemake.params.cfg, snakemake.params
    first, last = params.frames
    frames = frames_around_take(
        (first, last),
        params.source_frames or frames_of_video(source_path(params.source)),
        cfg["contours.detector.track.span"],
        cfg["contours.detector.track.frames"],
    )
    source = open_frames(params.source, snakemake.wildcards.subject, snakemake.wildcards.take)
    find, landmark_set = face_finder(
        cfg["landmarks.detector"],
        params.model,
        cfg["landmarks.networks"],
        cfg["landmarks.files"],
        str(snakemake.input.files),
    )
    finds = find_faces(lambda frame: source.read(params.camera, frame), find, frames, landmark_set)
    following = cfg["landmarks.following"]
    choice = FaceChoice.of(params.face, following["least_eyes_px"], following["person_difference"])
    own = SeenFaces.load(snakemake.input.faces)
    followed = FollowedFace.load(snakemake.input.followed)
    track = track_around(finds, own, followed, choice)
    track.save(snakemake.output.landmarks)
    print(f"the face in {track.valid.sum()} of {len(frames)} frames around {first} to {last}")


def frames_of_video(path) -> tuple[int, int]:
    """First and last frame of a video file."""
    from vermilion.imaging.video import VideoReader

    return 0, VideoReader(path).n_frames - 1


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
