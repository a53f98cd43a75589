"""Train the landmark regressor on the labelled frames of some takes."""

from vermilion.imaging.draw import tile, to_display
from vermilion.imaging.frames import open_frames
from vermilion.imaging.images import write_srgb8
from vermilion.landmarks.detect import draw_landmarks
from vermilion.landmarks.labels import read_labels
from vermilion.landmarks.training import LandmarkTrainingSettings, labelled_images, train_descent
from vermilion.provenance.begun_run import begin_job


def main(snakemake):
    settings = LandmarkTrainingSettings(**snakemake.params.cfg["landmarks.training"])
    labels, sources = [], {}
    for take in snakemake.params.takes:
        name = (take["subject"], take["take"])
        sources[name] = open_frames(take["source"], *name)
        labels += [(sources[name], label) for label in read_labels(take["source"])]
    images, points = labelled_images(labels, settings.max_frames)
    detector = train_descent(images, points, settings)
    drawn = [draw_landmarks(to_display(p), detector.detect(p)) for p in images[:12]]
    write_srgb8(snakemake.output.overlay, tile(drawn, 4))
    detector.save(snakemake.output.model)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
