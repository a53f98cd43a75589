"""Original, virtual make-up and checkerboard of a chunk, side by side."""

import numpy as np

from vermilion.appearance.estimate import Appearance
from vermilion.config.apply import MakeUpConfig, OverlayConfig
from vermilion.export.makeup import MakeUp, eye_shadow, lipstick, star
from vermilion.export.shots import framing
from vermilion.faces.model import FaceModel
from vermilion.imaging.draw import label, to_display
from vermilion.imaging.frames import open_frames
from vermilion.imaging.images import write_srgb8
from vermilion.imaging.video import write_video
from vermilion.landmarks.scheme import EYE_LEFT
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.errors import InputError
from vermilion.storage.progress import progress
from vermilion.storage.sequences import read_sequence
from vermilion.tracking.image_fit.overlay import samples_to_vertices
from vermilion.tracking.result import Identity, TrackedTake

NAMES = ("original", "make-up", "checkerboard")


def pigments(model, neutral, options):
    """Eye shadow, lipstick, and a star under the left eye."""
    cheek = neutral[model.landmarks[EYE_LEFT[3]]] + [2.0, -24.0, 0.0]
    return [
        eye_shadow(model, neutral, options.eye_shadow, options.eye_shadow_opacity),
        lipstick(options.lipstick, options.lipstick_opacity),
        star(cheek, 8.0, 0.2, options.star, options.star_opacity),
    ]


def main(snakemake):
    inputs, params = snakemake.input, snakemake.params
    place = (snakemake.wildcards.subject, snakemake.wildcards.take)
    options = MakeUpConfig(**params.cfg["apply.makeup"])
    overlay = OverlayConfig(**params.cfg["apply.overlay"])
    model, neutral = FaceModel.load(inputs.tracker), Identity.load(inputs.identity).neutral_mm
    fit, found = TrackedTake.load(inputs.fit), Appearance.load(inputs.appearance)
    albedo = samples_to_vertices(
        found.albedo[0], np.minimum(found.seen, 1.0), found.samples, model.triangles, len(neutral)
    )
    layers = pigments(model, neutral, options)
    makeup = MakeUp(model, neutral, found.light, albedo, layers, options.checker_mm)
    corrected = read_sequence(inputs.corrected)
    rows, camera = fit.index_of(params.frames), fit.camera
    source = open_frames(params.source, *place)
    crop = framing(model, neutral, fit, overlay.margin, overlay.panel_height_px).face
    shown = []

    def panels(index):
        try:
            image = source.read(camera.name, int(params.frames[index]))
        except InputError:
            image = np.zeros((camera.height_px, camera.width_px, 3), np.float32)
        drawn = (image, image)
        if fit.valid[rows[index]]:
            drawn = makeup.draw(image, camera, np.asarray(corrected[index], dtype=np.float64))
        row = [crop.of_image(to_display(part)) for part in (image, *drawn)]
        joined = np.hstack([label(*pair) for pair in zip(row, NAMES, strict=True)])
        if index in (0, len(rows) // 2):
            shown.append(joined)
        return joined

    images = (panels(index) for index in range(len(rows)))
    write_video(snakemake.output.video, progress(images, "make-up", len(rows)), params.fps)
    write_srgb8(snakemake.output.image, np.vstack(shown))


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
