"""A folder in which the sketch page can open a take: a generated mouth, its track, its images.

Nothing of the workflow has run there; the files of its results are written as the stages write them, so
that only the stage `guided` is left to run.
"""

from __future__ import annotations

import os
import shutil
import time
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import yaml

from tests.unit import guided_mouths as mouths
from tests.unit.procedural_mouth import mouth
from vermilion.contours.maps import write_maps
from vermilion.geometry.camera import write_cameras
from vermilion.imaging.draw import draw_mesh
from vermilion.imaging.images import write_srgb8
from vermilion.storage.sequences import write_sequence
from vermilion.storage.tables import write_table
from vermilion.tracking.landmark_fit.expression import HeadMotion
from vermilion.tracking.result import Identity, TrackedTake

ROOT = Path(__file__).resolve().parents[1]
N_FRAMES, CAMERA, TAKE = 6, "cam", "s/t"
SUGGESTED, LOST = (4, 1), 3
CHUNK = f"000000-{N_FRAMES - 1:06d}"
SKIN, RED = (0.80, 0.62, 0.52), (0.66, 0.30, 0.30)


@dataclass(frozen=True)
class SketchTake:
    """A folder with a take to draw on.

    Attributes:
        folder: where the server starts.
        true_mm, base_mm: (F, V, 3) meshes, world; the base lacks the smile that comes with the jaw.
    """

    folder: Path
    true_mm: np.ndarray
    base_mm: np.ndarray
    configuration: str = "take.yaml"

    @property
    def labels(self) -> Path:
        return self.folder / "capture" / "labels"

    @property
    def results(self) -> Path:
        return self.folder / "results" / "take"


def make_take(folder: Path, rendered: bool = False) -> SketchTake:
    """Write everything; images are flat, or `rendered` meshes."""
    face, camera = mouths.face(), mouths.camera(CAMERA)
    jaws = np.linspace(0.15, 0.45, N_FRAMES)
    true = np.array([mouth(face, j, mouthFunnel=j, mouthSmile_L=j) for j in jaws])
    base = np.array([mouth(face, j) for j in jaws])
    _write_configuration(folder)
    results = folder / "results" / "take"
    taken = results / "takes" / "s" / "t"
    (results / "face_model").mkdir(parents=True)
    face.save(results / "face_model" / "tracker.npz")
    none = np.zeros(0)
    Identity(
        none, face.neutral_mm, np.zeros((66, 3)), none.astype(str), none, none.astype(bool)
    ).save(results / "subjects" / "s" / "identity.npz")
    motion = HeadMotion(
        np.repeat(camera.rotation[None], N_FRAMES, axis=0),
        np.repeat(camera.translation[None], N_FRAMES, axis=0),
        np.zeros((N_FRAMES, face.n_expressions)), np.zeros(N_FRAMES),
    )  # fmt: skip
    valid = np.arange(N_FRAMES) != LOST
    TrackedTake.of(np.arange(N_FRAMES), motion, valid, camera, face).save(
        taken / "tracking" / "fit.npz"
    )
    write_cameras(taken / "cameras", {CAMERA: camera})
    write_sequence(taken / "tracking" / "C" / f"{CHUNK}.npy", base)
    # Jobs of earlier stages ask for these; no job of the stage `guided` opens them.
    for name in (f"capture/{CHUNK}.json", "capture/cameras.json", f"landmarks/{CHUNK}.npz"):
        (taken / name).parent.mkdir(exist_ok=True)
        (taken / name).touch()
    rows = [{"rank": k + 1, "frame": f, "unexplained_after": 0.1} for k, f in enumerate(SUGGESTED)]
    write_table(taken / "guided" / "suggestions.tsv", pd.DataFrame(rows))
    colours = np.where(
        (face.regions["vermilion_upper"] | face.regions["vermilion_lower"])[:, None], RED, SKIN
    )
    empty = np.full((camera.height_px, camera.width_px, 3), 60, "u1")
    for frame in range(N_FRAMES):
        image = empty
        if rendered:
            image = draw_mesh(empty, camera, true[frame], face.triangles, colours)
        write_srgb8(folder / "capture" / "frames" / CAMERA / f"{frame:06d}.png", image)
        write_ridges(taken / "contours" / CHUNK / f"{frame:06d}.exr", true[frame])
    # All of one age: nothing is newer than what was made from it.
    now = time.time()
    for path in [*results.rglob("*"), *(folder / "capture").rglob("*")]:
        os.utime(path, (now, now))
    return SketchTake(folder, true, base)


def write_ridges(path: Path, mesh_mm: np.ndarray) -> None:
    """Likelihood maps as a detector would draw them: ridges along the true contours."""
    camera, maps = mouths.camera(CAMERA), []
    drawn = mouths.drawn(mesh_mm, camera, outer=True).curves
    for part in ("inner", "outer"):
        away = np.full((camera.height_px, camera.width_px), 255, "u1")
        for side in ("upper", "lower"):
            points = np.rint((drawn[f"{side}_{part}"].points_px - 0.5) * 16).astype(np.int32)
            cv2.polylines(away, [points], False, 0, 1, cv2.LINE_8, 4)
        away = cv2.distanceTransform(away, cv2.DIST_L2, 5)
        maps.append(np.exp(-0.5 * (away / 1.5) ** 2).astype(np.float32))
    path.parent.mkdir(parents=True, exist_ok=True)
    write_maps(path, *maps)


def _write_configuration(folder: Path) -> None:
    """The workflow, a configuration and a sheet; the rig takes are never made, but the rules ask for some."""
    folder.mkdir(parents=True, exist_ok=True)
    content = {
        "results": "results/take", "takes": "takes.tsv", "face_model": {"name": "procedural"},
        "studio": {"subjects": {"rig": {"seed": 1, "takes": {"rom": {"seed": 1}}}}},
        "tracking": {"image_fit": {"enabled": False}},
        "guided": {"takes": {TAKE: "base"}},
    }  # fmt: skip
    (folder / "take.yaml").write_text(yaml.safe_dump(content))
    rows = [
        "subject take role source first last fps split",
        "rig plain plain studio 0 0 30 none",
        "rig rom tattoo studio 0 9 30 test:6-9",
        f"s t video capture 0 {N_FRAMES - 1} 30 none",
    ]
    (folder / "takes.tsv").write_text("\n".join(row.replace(" ", "\t") for row in rows) + "\n")
    shutil.copy(ROOT / "Snakefile", folder)
    for name in ("workflow", "profiles"):
        unwanted = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / name, folder / name, ignore=unwanted)
