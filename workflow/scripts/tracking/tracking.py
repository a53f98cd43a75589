"""Pose and blend weights of a whole take."""

from vermilion.capture.video_facts import uneven_times
from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import read_cameras
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.provenance.begun_run import begin_job
from vermilion.tracking.landmark_fit.expression import fit_motion
from vermilion.tracking.landmark_fit.observation import Observations, focal_px, with_focal
from vermilion.tracking.landmark_fit.shape import LandmarkShape
from vermilion.tracking.landmark_fit.timeline import Timeline
from vermilion.tracking.landmark_fit.turned import as_seen_turned, model_meshes, turned_frames
from vermilion.tracking.result import Identity, TrackedTake
from vermilion.tracking.settings import landmark_fit_settings
from vermilion.tracking.validity import valid_frames

#: Fits with what turned heads hide taken out; each knows better where the heads are.
TURNED_ROUNDS = 3


def main(snakemake):
    inputs, cfg = snakemake.input, snakemake.params.cfg
    tracker, person = FaceModel.load(inputs.tracker), Identity.load(inputs.identity)
    track = LandmarkTrack.load(list(inputs.landmarks))
    camera = with_focal(
        read_cameras(inputs.cameras)[snakemake.params.camera],
        person.focal_of(snakemake.wildcards.take),
    )
    seen = Observations.of(track, camera)
    shape = LandmarkShape.of(tracker, person.identity, person.landmark_offset_mm)
    settings = landmark_fit_settings(cfg["tracking.fit"], cfg["tracking.motion"])
    times = uneven_times(inputs.get("video"), track.frames)
    timeline = Timeline.of(len(track.frames), snakemake.params.fps, track.pieces, times)
    motion = fit_motion(shape, seen, focal_px(camera), timeline, settings)
    for _ in range(TURNED_ROUNDS):
        turned = turned_frames(motion.rotation, motion.translation_mm)
        if not turned.any():
            break
        head = model_meshes(tracker, person.identity, motion)
        visible = as_seen_turned(seen, tracker, head, turned, focal_px(camera))
        motion = fit_motion(shape, visible, focal_px(camera), timeline, settings)
    limit = cfg["tracking.motion"]["max_reprojection"]
    valid = valid_frames(motion, shape, focal_px(camera), limit)
    fit = TrackedTake.of(track.frames, motion, valid, camera, tracker, track.pieces)
    fit.save(snakemake.output.fit)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
