"""Chunks and cores are a matter of speed alone."""

import numpy as np
import pytest

from .conftest import Project

pytestmark = pytest.mark.slow


def test_chunk_size_and_cores_change_no_result(finished):
    other = Project(finished.folder, "config/chunks.yaml")
    (finished.folder / other.configuration).write_text(
        (finished.folder / finished.configuration).read_text()
    )
    other.edit_configuration(lambda c: c.update(results="results/chunks", chunk_frames=7))
    pattern = "takes/s1/rom/{}/*.{}"
    parts = [("multiview/H", "npy"), ("tracking/C", "npy"), ("correction/layers", "npz")]
    targets = [
        f"results/chunks/takes/s1/rom/{folder}/{chunk}.{suffix}"
        for folder, suffix in parts
        for chunk in ("000000-000006", "000007-000011")
    ]
    run = other.snakemake("--cores", "1", *targets)
    assert "not to be trusted" not in run.stderr, "the end of every job is known"

    def joined(project, folder, suffix):
        files = sorted(project.results.glob(pattern.format(folder, suffix)))
        loaded = [np.load(f) if suffix == "npy" else np.load(f)["layers"] for f in files]
        return np.concatenate(loaded)

    for folder, suffix in parts:
        ours, theirs = joined(other, folder, suffix), joined(finished, folder, suffix)
        assert ours.shape == theirs.shape
        off = np.nanmax(np.abs(ours - theirs))
        assert off <= (0.01 if suffix == "npy" else 0.001), f"{folder}: {off}"
