"""Landmarks of the neutral in every camera of a rig, with an overlay."""

from pathlib import Path

from vermilion.geometry.camera import read_cameras
from vermilion.imaging.draw import label, tile, to_display
from vermilion.imaging.frames import open_frames
from vermilion.imaging.images import write_srgb8
from vermilion.landmarks.choose import open_detector
from vermilion.landmarks.detect import draw_landmarks
from vermilion.landmarks.detector import Landmarks
from vermilion.landmarks.table import GivenLandmarks
from vermilion.landmarks.views import LandmarkViews
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.errors import InputError


def main(snakemake):
    cfg, frame = snakemake.params.cfg, snakemake.params.frame
    source = open_frames(
        snakemake.params.source, snakemake.wildcards.subject, snakemake.wildcards.take
    )
    kind, detector = cfg["landmarks.detector"], None
    if kind != "files":
        detector = open_detector(kind, snakemake.params.model, cfg["landmarks.networks"])
    found, images = {}, []
    for camera in read_cameras(snakemake.input.cameras):
        found[camera] = Landmarks.none()
        try:
            image = source.read(camera, frame)
        except InputError as error:
            print(error)
            continue
        path = Path(snakemake.params.files.format(camera=camera))
        if detector is not None:
            found[camera] = detector.detect(image).as_ibug66()
        elif path.is_file():
            given = GivenLandmarks(**{**cfg["landmarks.files"], "path": str(path)})
            found[camera] = given.read().at(frame).as_ibug66()
        images.append(label(draw_landmarks(to_display(image), found[camera]), camera))
    write_srgb8(snakemake.output.overlay, tile(images, 5))
    LandmarkViews.of(found).save(snakemake.output.views)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
