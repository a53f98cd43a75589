"""Training database of a generic regressor: the truth of the studio's videos stands in place of H."""

import numpy as np

from vermilion.config.correction import LayersConfig
from vermilion.config.correspondence import CorrespondenceConfig
from vermilion.config.database import DatabaseConfig
from vermilion.correction.take_layers import displacements, quality_rows, take_layers
from vermilion.correspondence.correspondence import CorrespondenceSettings
from vermilion.correspondence.models import bind_models, model_correspondence
from vermilion.database.gather import motion_mm
from vermilion.database.schema import SubjectEntry, TakeEntry
from vermilion.database.write import write_database
from vermilion.faces.model import FaceModel
from vermilion.geometry.mesh import mesh_corners, vertex_areas
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.arrays import read_array, read_arrays
from vermilion.storage.chunks import read_chunks
from vermilion.storage.progress import progress
from vermilion.storage.sequences import read_sequence
from vermilion.tracking.result import Identity, TrackedTake


def layers_of(take, files, correspondence, face, cfg):
    """Layers of a whole take from its truth; the log tells of frames that nothing is learnt from."""
    fit = TrackedTake.load(files["fit"])
    made = take_layers(
        correspondence,
        read_array(files["truth"], "truth", subject=take["subject"], take=take["take"]),
        read_sequence(files["coarse"]),
        fit.world_from_head_rotation,
        fit.world_from_head_translation_mm,
        face=face.regions["face"],
    )
    made, rows = quality_rows(
        made,
        fit.frames,
        tracked=fit.valid,
        max_alignment_mm=cfg.max_alignment_mm,
    )
    for row in rows:
        if not row.valid:
            print(f"{take['subject']}/{take['take']}, frame {row.frame}: {row.reason}")
    return made


def entry_of(take, files, correspondence, made, lips, most_motion_mm):
    """The take as the database has it; `lips` (V,) are weights of the vermilion's vertices."""
    frames = TrackedTake.load(files["fit"]).frames
    measured = read_chunks(files["features"], frames, ["features", "valid"])
    valid = made.valid & measured["valid"] & np.isfinite(measured["features"]).all(axis=1)
    corners = mesh_corners(correspondence.coarse_triangles, correspondence.mask)
    moved = displacements(made, corners)
    valid[valid] &= motion_mm(moved[valid], lips[corners]) <= most_motion_mm
    print(f"{take['subject']}/{take['take']}: {valid.sum()} of {len(frames)} frames")
    return TakeEntry(
        **{name: take[name] for name in ("subject", "take", "fps", "split")},
        frames=frames,
        features=np.where(valid[:, None], measured["features"], 0.0),
        layers=made.layers,
        displacement_mm=moved,
        valid=valid,
        train=np.isin(frames, take["train"]),
    )


def main(snakemake):
    inputs, params = snakemake.input, snakemake.params
    full, face = FaceModel.load(inputs.studio), FaceModel.load(inputs.tracker)
    region = CorrespondenceConfig(**params.cfg["correspondence"]).model_dump(exclude={"landmarks"})
    settings, cfg = (
        CorrespondenceSettings(**region),
        LayersConfig(**params.cfg["correction.layers"]),
    )
    bound, maps, people = bind_models(full, face), {}, {}
    for subject, path in zip(params.subjects, inputs.identity, strict=True):
        neutral_mm = Identity.load(path).neutral_mm
        maps[subject] = model_correspondence(full, face, bound, neutral_mm, settings)
        people[subject] = SubjectEntry(subject, neutral_mm, maps[subject].mask)
    files = [
        {"truth": truth, "fit": fit} for truth, fit in zip(inputs.truth, inputs.fit, strict=True)
    ]
    coarse, features = iter(inputs.coarse), iter(inputs.features)
    for take, own in zip(params.takes, files, strict=True):
        own["coarse"] = [next(coarse) for _ in range(take["chunks"])]
        own["features"] = [next(features) for _ in range(take["chunks"])]

    options = DatabaseConfig(**params.cfg["database"]).model_dump()
    most_motion_mm = options.pop("generic_most_motion_mm")
    vermilion = face.regions["vermilion_upper"] | face.regions["vermilion_lower"]
    lips = np.where(vermilion, vertex_areas(face.neutral_mm, face.triangles), 0.0)

    def entries():
        for take, own in progress(list(zip(params.takes, files, strict=True)), "takes"):
            correspondence = maps[take["subject"]]
            made = layers_of(take, own, correspondence, face, cfg)
            yield entry_of(take, own, correspondence, made, lips, most_motion_mm)

    names = read_arrays(files[0]["features"][0], "features", ("names",))["names"]
    write_database(
        snakemake.output.database,
        face.triangles,
        [str(name) for name in names],
        list(people.values()),
        entries(),
        **options,
    )


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
