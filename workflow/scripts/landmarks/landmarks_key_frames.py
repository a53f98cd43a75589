"""Key frames of a take: given ones, and those chosen by local binary patterns, settled by flow."""

from vermilion.imaging.frames import open_frames
from vermilion.landmarks.correct_key_frames import correct_key_frames
from vermilion.landmarks.correction import LandmarkCorrectionSettings
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.landmarks.gradients import grey_of
from vermilion.landmarks.key_frames import KeyFrameSettings, find_key_frames, without_offset
from vermilion.landmarks.labels import labels_by_frame
from vermilion.landmarks.table import GivenLandmarks
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.tables import write_table


def main(snakemake):
    cfg, camera = snakemake.params.cfg["landmarks.key_frames"], snakemake.params.camera
    source = open_frames(
        snakemake.params.source, snakemake.wildcards.subject, snakemake.wildcards.take
    )
    track = LandmarkTrack.load(list(snakemake.input.landmarks))
    given = {}
    for path in snakemake.input.files:
        found = GivenLandmarks(**{**cfg["files"], "path": path}).read().by_frame
        given |= {frame: entry.as_ibug66().points_px for frame, entry in found.items()}
    drawn = labels_by_frame(
        snakemake.input.labels,
        source.size(camera),
        subject=snakemake.wildcards.subject,
        take=snakemake.wildcards.take,
    )
    given |= drawn  # a person is right where both speak
    track = without_offset(track, given)

    def read_grey(frame):
        return grey_of(source.read(camera, frame))

    keys = find_key_frames(
        read_grey, track, given, settings=KeyFrameSettings(cfg["share"], cfg["max_clip"])
    )
    correction = snakemake.params.cfg["landmarks.correction"]
    keys = correct_key_frames(read_grey, track, keys, LandmarkCorrectionSettings.of(correction))
    print(f"{len(keys.frames)} key frames of {len(track.frames)} frames")
    write_table(snakemake.output.table, keys.table())
    keys.save(snakemake.output.key_frames)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
