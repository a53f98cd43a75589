"""The face model of another tracker's topology: labels, and the space of its shape coefficients."""

import numpy as np

from vermilion.config.tracking import ExternalBaseConfig
from vermilion.external.motion import displacements_of, neutral_in_head
from vermilion.external.shape_modes import with_blend_shapes, with_modes
from vermilion.external.weights_file import read_weights
from vermilion.faces.model import FaceModel
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.chunks import read_frames


def training_frames(model, take, paths, neutral_path):
    """Displacements (n, V, 3) of the frames of a take that have a mesh, and their numbers (n,)."""
    own_neutral = read_frames([neutral_path], [take["neutral"]])[0].astype(float)
    frames = np.array(take["frames"])
    meshes = read_frames(paths, frames)
    moved, _ = displacements_of(model, meshes, neutral_in_head(model, own_neutral))
    there = np.isfinite(moved).all(axis=(1, 2))
    return moved[there].astype(np.float32), frames[there]


def own_weights(takes, frames):
    """Names and weights (N, K) of the tracker's blend shapes in the frames of each take."""
    named, parts = None, []
    for take, numbers in zip(takes, frames, strict=True):
        names, weights = read_weights(
            take["weights"], numbers, names=named, first=take["first"], fps=take["fps"],
            subject=take["subject"], take=take["take"],
        )  # fmt: skip
        named = names
        parts.append(weights)
    return named, np.concatenate(parts)


def main(snakemake):
    inputs, takes = snakemake.input, snakemake.params.takes
    options = ExternalBaseConfig(**snakemake.params.cfg["tracking.external.base"])
    model = FaceModel.load(inputs.topology)
    moved, numbers, start = [], [], 0
    for index, take in enumerate(takes):
        paths = inputs.coarse[start : start + take["chunks"]]
        start += take["chunks"]
        found, frames = training_frames(model, take, paths, inputs.neutrals[index])
        moved.append(found)
        numbers.append(frames)
    displacements = np.concatenate(moved)
    if options.weights:
        names, weights = own_weights(takes, numbers)
        known = np.isfinite(weights).all(axis=1)
        made = with_blend_shapes(model, displacements[known], weights[known], names)
    else:
        made = with_modes(model, displacements, options.variance, options.modes)
    print(f"{len(displacements)} training frames, {made.n_expressions} expressions")
    made.save(snakemake.output.model)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
