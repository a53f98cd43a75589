"""The refinement stage from a landmark fit to the track, offsets and tables."""

from dataclasses import replace

import numpy as np
import pytest

from tests.stages.run_script import run_script
from tests.unit.image_fit_scene import CAMERA, dome, image_of, mesh_of, motion, take_parts
from vermilion.config.tracking import TrackingConfig
from vermilion.imaging.images import read_image, write_image
from vermilion.storage.sequences import read_sequence
from vermilion.storage.tables import read_table
from vermilion.tracking.result import TrackedTake

pytestmark = pytest.mark.slow

N_FRAMES = 6
MODEL = dome()
NAMES = {"subject": "s", "take": "t"}
STEPS = ["landmarks", "image_fit", "offsets"]


def run_stage(root, sizes):
    """All scripts of the stage, in chunks of these sizes; returns the refined track."""
    truth = motion(N_FRAMES)
    start = truth.copy()
    # Each frame off by itself: what all have in common, the albedo would take for its own.
    rng = np.random.default_rng(4)
    start[:, 3:5] += rng.normal(0, 1.0, (N_FRAMES, 2))
    start[:, 6:] = np.clip(start[:, 6:] + rng.normal(0, 0.1, (N_FRAMES, 3)), 0, 1)
    fit, person, track = take_parts(MODEL, truth, start)
    MODEL.save(root / "tracker.npz")
    person.save(root / "identity.npz")
    fit.save(root / "landmark_fit.npz")
    for frame, row in enumerate(truth):
        path = root / "frames" / "cam" / f"{frame:06d}.exr"
        write_image(path, image_of(MODEL, mesh_of(MODEL, row)))
    landmarks, chunks, first = [], [], 0
    for size in sizes:
        frames = list(range(first, first + size))
        path = root / f"{frames[0]:06d}-{frames[-1]:06d}.npz"
        part = replace(
            track,
            frames=track.frames[frames],
            points_px=track.points_px[frames],
            confidence=track.confidence[frames],
            valid=track.valid[frames],
        )
        part.save(path)
        landmarks.append(path)
        chunks.append(frames)
        first += size
    cfg = {f"tracking.{k}": v for k, v in TrackingConfig().model_dump(mode="json").items()}
    image_fit = TrackingConfig().image_fit.model_dump(mode="json")
    cfg |= {f"tracking.image_fit.{k}": v for k, v in image_fit.items()}
    cfg["tracking.image_fit.appearance"]["frames"] = 4
    both = {"tracker": root / "tracker.npz", "identity": root / "identity.npz"}
    before = both | {"fit": root / "landmark_fit.npz"}
    run_script(
        "tracking/appearance",
        wildcards=NAMES,
        params={"cfg": cfg, "source": str(root)},
        input=before | {"landmarks": landmarks},
        output={"appearance": root / "appearance.npz", "overlay": root / "appearance.png"},
    )
    with_appearance = {"appearance": root / "appearance.npz"}
    for frames, path in zip(chunks, landmarks, strict=True):
        run_script(
            "tracking/image_fit",
            wildcards=NAMES,
            params={"cfg": cfg, "source": str(root), "frames": frames},
            input=before | with_appearance | {"landmarks": path},
            output={0: root / "image_fit" / path.name},
        )
    run_script(
        "tracking/image_fit_join",
        wildcards=NAMES,
        params={"cfg": cfg, "fps": 30.0},
        input=before
        | {"chunks": [root / "image_fit" / p.name for p in landmarks], "landmarks": landmarks},
        output={"fit": root / "fit.npz"},
    )
    after = both | with_appearance | {"fit": root / "fit.npz"}
    for frames, path in zip(chunks, landmarks, strict=True):
        offsets = root / "offsets" / f"{path.stem}.npy"
        run_script(
            "tracking/offsets",
            wildcards=NAMES,
            params={"cfg": cfg, "source": str(root), "frames": frames},
            input=after | {"landmarks": path},
            output={0: offsets},
        )
        run_script(
            "tracking/residuals",
            wildcards=NAMES,
            params={"cfg": cfg, "source": str(root), "frames": frames, "steps": STEPS},
            input=after
            | {"landmark_fit": root / "landmark_fit.npz", "landmarks": path, "offsets": offsets},
            output={
                "tables": [root / "residuals" / step / f"{path.stem}.tsv" for step in STEPS],
                "overlay": root / f"{path.stem}.png",
            },
        )
    return TrackedTake.load(root / "fit.npz"), truth


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    root = tmp_path_factory.mktemp("refinement")
    return root, *run_stage(root, [N_FRAMES])


def test_each_step_explains_more_of_the_images(results):
    root, fit, _ = results
    means = [
        read_table(root / "residuals" / step / "000000-000005.tsv")["residual"].mean()
        for step in STEPS
    ]
    assert means[0] > means[1] >= means[2] > 0
    assert means[1] < 0.8 * means[0]
    assert read_image(root / "000000-000005.png").shape[1] >= 4 * 480
    assert read_image(root / "appearance.png").shape == (480, 4 * 480, 3)
    assert fit.reprojection_px.max() < 2.0


def test_track_is_nearer_the_truth_than_the_landmark_fit(results):
    root, fit, truth = results

    def missed(track):
        local = MODEL.vertices(None, track.weights)
        meshes = local @ np.swapaxes(track.world_from_head_rotation, 1, 2)
        meshes = meshes + track.world_from_head_translation_mm[:, None]
        true = CAMERA.project(np.stack([mesh_of(MODEL, row) for row in truth]))
        return np.linalg.norm(CAMERA.project(meshes) - true, axis=-1).mean()

    assert missed(fit) < 0.7 * missed(TrackedTake.load(root / "landmark_fit.npz"))


def test_results_do_not_depend_on_chunks(results, tmp_path):
    root, fit, _ = results
    again, _ = run_stage(tmp_path, [4, 2])
    assert np.array_equal(again.weights, fit.weights)
    assert np.array_equal(again.world_from_head_rotation, fit.world_from_head_rotation)
    whole = read_sequence(root / "offsets" / "000000-000005.npy")
    parts = read_sequence(sorted((tmp_path / "offsets").glob("*.npy")))
    assert np.array_equal(np.asarray(whole), np.asarray(parts))
