"""Photometric residuals of a chunk after each step of the track, as tables and images."""

import numpy as np

from vermilion.appearance.estimate import Appearance
from vermilion.faces.model import FaceModel
from vermilion.imaging.frames import open_frames
from vermilion.imaging.images import write_srgb8
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.errors import InputError
from vermilion.storage.frames import evenly_spaced
from vermilion.storage.sequences import read_sequence
from vermilion.storage.tables import write_table
from vermilion.tracking.image_fit.overlay import residual_sheet
from vermilion.tracking.image_fit.residual import photometric_residual, sample_errors
from vermilion.tracking.image_fit.take import DenseLips, TakeStart
from vermilion.tracking.result import Identity, TrackedTake
from vermilion.tracking.settings import landmark_fit_settings


def main(snakemake):
    place = (snakemake.wildcards.subject, snakemake.wildcards.take)
    inputs, params, cfg = snakemake.input, snakemake.params, snakemake.params.cfg
    tracker, person = FaceModel.load(inputs.tracker), Identity.load(inputs.identity)
    track, appearance = LandmarkTrack.load(inputs.landmarks), Appearance.load(inputs.appearance)
    own = Appearance.load_pieces(inputs.appearance)
    settings = landmark_fit_settings(cfg["tracking.fit"], cfg["tracking.motion"])
    lips, steps, starts = DenseLips(**cfg["tracking.image_fit.lips"]), params.steps, {}
    for step in steps:
        fit = TrackedTake.load(inputs.landmark_fit if step == "landmarks" else inputs.fit)
        rows = fit.index_of(params.frames)
        starts[step] = TakeStart.of(tracker, person, fit, track, settings, rows, lips)
    face = starts["landmarks"].face(appearance.samples)
    moved = np.zeros((len(rows), tracker.n_vertices, 3))
    if "offsets" in steps:
        moved = read_sequence(inputs.offsets)
    at = appearance.samples.matrix(tracker.triangles, tracker.n_vertices)
    source = open_frames(params.source, *place)
    shown = set(evenly_spaced(len(rows), cfg["tracking.image_fit.overlay_frames"]).tolist())
    tables, sheet = {step: [] for step in steps}, []
    for index, frame in enumerate(params.frames):
        appearance = own.get(int(fit.pieces[rows[index]]), appearance)
        try:
            image = source.read(fit.camera.name, int(frame)) if fit.valid[rows[index]] else None
        except InputError:
            image = None
        results = []
        for step, start in starts.items():
            row = {
                "frame": frame,
                "residual": np.nan,
                "learnt_from": int(frame in appearance.frames),
            }
            if image is not None:
                pixel_mm = cfg["tracking.image_fit.appearance"]["pixel_mm"]
                view = start.view(index, image, face, pixel_mm, 1)
                offsets = at @ moved[index] if step == "offsets" else 0.0
                errors, trust, places = sample_errors(view, view.start, face, appearance, offsets)
                row["residual"] = photometric_residual(errors, trust)
                results.append((f"{step} {row['residual']:.2f}", errors, trust, places))
            tables[step].append(row)
        if image is not None and index in shown:
            sheet.append((f"{frame}", image, results))
    write_srgb8(snakemake.output.overlay, residual_sheet(sheet, fit.camera))
    for step, path in zip(steps, snakemake.output.tables, strict=True):
        write_table(path, tables[step])


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
