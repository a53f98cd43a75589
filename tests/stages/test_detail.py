"""The finer sequence from images and coarse meshes: better, and the same for any chunks."""

import cv2
import numpy as np
import pytest

from tests.stages.run_script import run_script
from vermilion.config.detail import DetailConfig
from vermilion.faces.model import REGIONS, FaceModel
from vermilion.geometry.camera import look_at, pinhole
from vermilion.geometry.raycast import RayCaster, interpolate
from vermilion.imaging.images import read_image, write_image
from vermilion.storage.sequences import read_sequence, write_sequence
from vermilion.storage.tables import read_table
from vermilion.tracking.landmark_fit.expression import HeadMotion
from vermilion.tracking.result import TrackedTake

pytestmark = pytest.mark.slow

N_FRAMES = 4
CAMERA = pinhole(
    "cam", 500.0, 160, 140, look_at(np.array([20.0, 10, 500]), np.zeros(3), np.array([0.0, 1, 0]))
)


def face():
    """A curved sheet with a texture of its own, as a model."""
    x, y = np.meshgrid(np.linspace(-50, 50, 25), np.linspace(-45, 45, 25))
    vertices = np.stack([x, y, 20 - (x**2 + y**2) / 150], axis=2).reshape(-1, 3)
    corner = (np.arange(24)[:, None] * 25 + np.arange(24)).reshape(-1)
    triangles = np.concatenate(
        [
            np.stack([corner, corner + 1, corner + 25], axis=1),
            np.stack([corner + 1, corner + 26, corner + 25], axis=1),
        ]
    ).astype(np.int32)
    regions = {name: np.zeros(len(vertices), dtype=bool) for name in REGIONS}
    regions["face"][:] = True
    regions["rigid"] = vertices[:, 1] > 15
    uv = (vertices[:, :2] + 50) / 100
    loop = np.arange(4)
    return FaceModel(
        "sheet", vertices, triangles, ("none",), np.zeros((1, len(vertices), 3), np.float32),
        np.zeros((0, len(vertices), 3), np.float32), uv, np.zeros(66, int), loop, loop, regions,
    )  # fmt: skip


MODEL = face()


def true_and_coarse():
    """The sheet stretches over time; the coarse track lags behind by a growing part."""
    frames = np.arange(N_FRAMES)[:, None]
    low = np.maximum(-MODEL.neutral_mm[:, 1] - 10, 0) / 35
    true = np.repeat(MODEL.neutral_mm[None], N_FRAMES, axis=0)
    coarse = true.copy()
    true[:, :, 1] -= 2.5 * frames * low
    coarse[:, :, 1] -= 1.2 * frames * low
    return true, coarse


def texture():
    rng, total = np.random.default_rng(1), np.full((256, 256, 3), 0.35, dtype=np.float32)
    for scale in (2.5, 6, 16):
        noise = cv2.GaussianBlur(rng.normal(size=total.shape).astype(np.float32), (0, 0), scale)
        total += 0.06 * noise / noise.std()
    return np.clip(total, 0.02, 0.95)


def render(vertices):
    hits = RayCaster(vertices, MODEL.triangles).see(CAMERA)
    places = (interpolate(hits, MODEL.triangles, MODEL.uv) * 255).astype(np.float32)
    colours = cv2.remap(texture(), places, None, cv2.INTER_LINEAR)
    return np.where(hits.hit[..., None], colours, 0.1)


def write_take(root, sizes, coarse, image_of, missing=()):
    """Tracker, fit, images (`image_of` a frame) and coarse meshes (F, V, 3) in chunks of `sizes`."""
    n_frames = len(coarse)
    MODEL.save(root / "tracker.npz")
    motion = HeadMotion(
        np.repeat(np.eye(3)[None], n_frames, axis=0),
        np.zeros((n_frames, 3)),
        np.zeros((n_frames, 1)),
        np.zeros(n_frames),
    )
    valid = np.ones(n_frames, dtype=bool)
    TrackedTake.of(np.arange(n_frames), motion, valid, CAMERA, MODEL).save(root / "fit.npz")
    for frame in range(n_frames):
        if frame not in missing:
            write_image(root / "frames" / "cam" / f"{frame:06d}.png", image_of(frame))
    paths = []
    for first, size in zip(np.cumsum([0, *sizes]), sizes, strict=False):
        paths.append(root / "C" / f"{first:06d}-{first + size - 1:06d}.npy")
        write_sequence(paths[-1], coarse[first : first + size])
    return paths


def prepare(root, sizes, missing=()):
    true, coarse = true_and_coarse()
    return true, coarse, write_take(root, sizes, coarse, lambda f: render(true[f]), missing)


def run_stage(root, paths):
    cfg = DetailConfig(overlay_frames=2).model_dump(mode="json")
    cfg = {f"detail.{key}": value for key, value in cfg.items()}
    for path in paths:
        first, last = (int(n) for n in path.stem.split("-"))
        run_script(
            "detail/detail_flow",
            wildcards={"subject": "s", "take": "t", "chunk": path.stem},
            params={
                "cfg": cfg, "source": str(root), "frames": list(range(first, last + 1)),
                "span": [0, N_FRAMES - 1],
            },
            input={"tracker": root / "tracker.npz", "fit": root / "fit.npz", "coarse": paths},
            output={
                "meshes": root / "flow" / path.name,
                "quality": root / f"quality{path.stem}.tsv",
                "overlay": root / f"overlay{path.stem}.png",
                "start": root / f"start{path.stem}.tsv",
                "flow": root / f"after{path.stem}.tsv",
            },
        )  # fmt: skip
    return read_sequence([root / "flow" / path.name for path in paths])


def test_meshes_come_nearer_the_truth_whatever_the_chunks(tmp_path):
    true, coarse, paths = prepare(tmp_path / "one", [N_FRAMES])
    whole = run_stage(tmp_path / "one", paths)
    _, _, paths = prepare(tmp_path / "two", [1, N_FRAMES - 1])
    assert (run_stage(tmp_path / "two", paths) == whole).all()

    def error_mm(sequence):
        return np.linalg.norm(sequence[1:] - true[1:], axis=2).mean(axis=1)

    assert (error_mm(whole) < 0.5 * error_mm(coarse)).all()
    name = f"000000-{N_FRAMES - 1:06d}"
    start = read_table(tmp_path / "one" / f"start{name}.tsv", ["frame", "residual"])
    after = read_table(tmp_path / "one" / f"after{name}.tsv", ["frame", "residual"])
    assert (after["residual"][1:] < 0.7 * start["residual"][1:]).all()
    assert read_image(tmp_path / "one" / f"overlay{name}.png").std() > 0


def test_missing_image_leaves_the_coarse_mesh_and_says_so(tmp_path):
    _, coarse, paths = prepare(tmp_path, [N_FRAMES], missing=(2,))
    found = run_stage(tmp_path, paths)
    assert np.abs(found[2] - coarse[2]).max() < 1e-4
    rows = read_table(tmp_path / f"quality{paths[0].stem}.tsv").set_index("frame")
    assert rows.loc[2, "valid"] == 0 and "not corrected" in rows.loc[2, "reason"]
