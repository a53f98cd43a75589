"""A folder in which the sketch page can open a take: a generated mouth, its track, its images.

Nothing of the workflow has run there; the files of its results are written as the stages write them.
"""

from __future__ import annotations

import shutil
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
    write_sequence(taken / "tracking" / "C" / f"000000-{N_FRAMES - 1:06d}.npy", base)
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
        write_ridges(taken / "contours" / "000000-000005" / f"{frame:06d}.exr", true[frame])
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
    folder.mkdir(parents=True, exist_ok=True)
    content = {
        "results": "results/take", "takes": "takes.tsv", "face_model": {"name": "procedural"},
        "guided": {"takes": {TAKE: "base"}},
    }  # fmt: skip
    (folder / "take.yaml").write_text(yaml.safe_dump(content))
    header = "subject\ttake\trole\tsource\tfirst\tlast\tfps\tsplit"
    row = f"s\tt\tvideo\tcapture\t0\t{N_FRAMES - 1}\t30\tnone"
    (folder / "takes.tsv").write_text(f"{header}\n{row}\n")
    shutil.copytree(ROOT / "workflow" / "rules", folder / "workflow" / "rules", dirs_exist_ok=True)
