"""Weights of a rig for corrected takes: how far the lips are off, with and without the corrective.

Takes a finished run and its corrected takes. The rig is ARKit's shapes of the face model, as `live_link` solves them,
not made for the person's corrected lips. It stands on one neutral after another:

- `tracked`: the face model's, of the tracked identity, which no facility would give its actor;
- `static`: with what of the correction stands still in the take, as the export has it where no neutral frame is marked;
- `frame`: with the corrected mouth of the frame that shows the neutral (`correction.neutral_frames`), as the export has it
  where one is marked;
- `multi-view`: the neutral **H** of the subject's rig take, which `neutral_pair` has on this mesh;
- `truth`: the true surface where H's neutral lies, of takes with a truth.

The last two lie on the take's own mouth by one rigid motion, since they are heads of another size; the rest of the face is the
tracked one. Prints the distance over the vermilion in mm: mean of all frames (worst frame) of the rig alone; its
motion, each vertex's mean offset removed; of the neutral alone, with all weights 0 (`null`); with the corrective; the sum of the mouth's weights in the marked frame, which should
be 0; and the RMS of weights (and of their motion) to those that drove the studio's actor. Bars: 0.8 mm alone on the actor's own neutral, 0.3 mm with the corrective.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.common import add_run_arguments, print_table
from benchmarks.finished_run import FinishedRun
from vermilion.correction.neutral_pair import NeutralPair
from vermilion.correspondence.correspondence import Correspondence
from vermilion.export.animation import Animation, HeadFrame, NamedShapes
from vermilion.export.full_topology import shapes_on_coarse
from vermilion.export.head_pose import corrected_pose
from vermilion.export.rig import RigWeights, solve_rig
from vermilion.export.static_correction import moves_lips, on_own_neutral
from vermilion.faces.model import FaceModel
from vermilion.geometry.alignment import similarity_alignment
from vermilion.geometry.closest_points import Surface
from vermilion.geometry.mesh import mesh_corners
from vermilion.geometry.polygons import Polygons
from vermilion.multiview.files import read_neutral
from vermilion.storage.sequences import read_sequence

ALL = "all"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """A finished run and a take."""
    add_run_arguments(parser, ALL)


@dataclass(frozen=True)
class Scene:
    """A corrected take as `apply_export` has it, on the tracker's mesh of V vertices.

    Attributes:
        run: where it is.
        face: the tracker's model.
        take: the sequence.
        lips, mask: (V,) bool, the vermilion and what is corrected.
    """

    run: FinishedRun
    face: FaceModel
    take: Animation
    lips: np.ndarray
    mask: np.ndarray

    @classmethod
    def of(cls, run: FinishedRun) -> Scene:
        """Read it; without a correspondence, the mask is the lips and what is inside."""
        face, fit = run.tracker_model(), run.fit()
        shapes = NamedShapes(face.expression_names, face.expressions_mm, fit.weights)
        head = HeadFrame(fit.world_from_head_rotation, fit.world_from_head_translation_mm)
        corrected = read_sequence(run.results / "apply" / run.take / "corrected.npy")
        take = Animation(
            fit.frames, 25.0, corrected, Polygons.of_triangles(face.triangles),
            run.identity().neutral_mm, head, shapes, 1.0,
        )  # fmt: skip
        take = replace(take, head=corrected_pose(take, face.regions["rigid"]))
        lips = face.regions["vermilion_upper"] | face.regions["vermilion_lower"]
        mask, path = lips | face.regions["mouth_inner"], run.subject_folder / "correspondence.npz"
        if path.exists():
            found = Correspondence.load(path)
            mask = np.zeros(face.n_vertices, dtype=bool)
            mask[mesh_corners(found.coarse_triangles, found.mask)] = True
        return cls(run, face, take, lips, mask)

    def local_mm(self, row: int) -> np.ndarray:
        """Vertices (V, 3) of a frame in the head frame."""
        return self.take.head.to_head(row, np.asarray(self.take.vertices_mm[row], np.float64))

    def neutral_row(self) -> int | None:
        """Row of the marked neutral frame: the one whose coarse mesh its `neutral_pair` holds."""
        path = self.run.folder / "correction" / "neutral_pair.npz"
        if not path.exists():
            return None
        fit, pair = self.run.fit(), NeutralPair.load(path)
        head = HeadFrame(fit.world_from_head_rotation, fit.world_from_head_translation_mm)
        meshes = enumerate(self.run.coarse_mm())
        away = [np.abs(head.to_head(row, mesh) - pair.coarse_mm).max() for row, mesh in meshes]
        return int(np.argmin(away))

    def neutrals(self) -> Iterator[tuple[str, np.ndarray]]:
        """Names and neutrals (V, 3), head frame."""
        valid = self.run.fit().valid
        own = on_own_neutral(self.take, self.lips, valid).neutral_mm
        yield "tracked", self.take.neutral_mm
        yield "static", own
        row = self.neutral_row()
        if row is not None:
            frame = int(self.take.frames[row])
            yield "frame", on_own_neutral(self.take, self.lips, valid, frame).neutral_mm
        # That of the take itself is the same H, laid on another frame.
        for path in sorted(self.run.folder.parent.glob("*/correction/neutral_pair.npz"))[:1]:
            yield "multi-view", self.laid(NeutralPair.load(path).accurate_mm, own)
        true = self.true_neutral()
        if true is not None:
            yield "truth", self.laid(true, own)

    def laid(self, neutral_mm: np.ndarray, own_mm: np.ndarray) -> np.ndarray:
        """The tracked neutral with the mouth of neutral_mm (V, 3), laid on that of own_mm (V, 3)."""
        mask = self.mask & np.isfinite(neutral_mm).all(axis=1)
        move = similarity_alignment(neutral_mm[mask], own_mm[mask], scale=1.0)
        result = self.take.neutral_mm.astype(np.float64)
        result[mask] = move.apply(neutral_mm[mask])
        return result

    def true_weights(self, names: tuple[str, ...]) -> np.ndarray:
        """Weights (F, K) that drove the actor, of the take's rows; NaN where nobody knows them."""
        path, rows = self.run.truth / "weights.json", self.take.rows
        known = json.loads(path.read_text()) if path.exists() else []
        if len(known) != len(self.take.frames):
            return np.full((len(rows), len(names)), np.nan)
        return np.array([[known[row].get(name, 0.0) for name in names] for row in rows])

    def true_neutral(self) -> np.ndarray | None:
        """The truth's points nearest to H's neutral, (V, 3) on this mesh, NaN where H has none; None: no truth."""
        path = self.run.subject_folder / "correspondence.npz"
        for sequence in (
            sorted(self.run.folder.parent.glob("*/multiview/H")) if path.exists() else ()
        ):
            multiview, truth = sequence.parent, self.run.truth.parent / sequence.parts[-3]
            if (truth / "vertices_mm.npy").exists():
                count = self.run.model("template").n_vertices
                neutral = read_neutral(multiview / "neutral.npz", count)
                points = Correspondence.load(path).on_coarse(neutral)
                known = np.isfinite(points).all(axis=1)
                mesh = np.load(truth / "vertices_mm.npy", mmap_mode="r")[0].astype(np.float64)
                triangles = np.load(truth / "triangles.npy")
                near = Surface(mesh, triangles).closest(points[known])
                points[known] = near.sample(mesh, triangles)
                return points
        return None


def figures(scene: Scene, rig: NamedShapes, neutral_mm: np.ndarray) -> dict[str, float | str]:
    """A row of the table for a rig that stands on neutral_mm (V, 3)."""
    take = replace(scene.take, neutral_mm=neutral_mm)
    found, row = solve_rig(take, rig, scene.lips), scene.neutral_row()
    result: dict[str, float | str] = {
        "alone": f"{found.left_mm.mean():.2f} ({found.left_mm.max():.2f})",
        "motion": _motion_mm(scene, rig, neutral_mm, found),
        "null": float(np.linalg.norm(_from_neutral(scene, neutral_mm), axis=2).mean()),
        "with corrective": f"{found.corrected_mm.mean():.2f} ({found.corrected_mm.max():.2f})",
        "shapes used": float((found.alone > 0.01).sum(axis=1).mean()),
    }
    if row is not None:
        mouth = moves_lips(rig.shapes_mm, scene.lips)
        result["at rest"] = float(found.alone[scene.take.rows.index(row), mouth].sum())
    off = found.alone - scene.true_weights(rig.names)
    if np.isfinite(off).all():
        moving = off - off.mean(axis=0)
        result["weights off"], result["moving"] = (
            np.sqrt((off**2).mean()),
            np.sqrt((moving**2).mean()),
        )
    return result


def _motion_mm(scene: Scene, rig: NamedShapes, neutral_mm: np.ndarray, found: RigWeights) -> float:
    """Distance over the lips of the rig alone, without each vertex's mean offset over the frames."""
    shapes = np.asarray(rig.shapes_mm, np.float64)[:, scene.lips]
    left = _from_neutral(scene, neutral_mm) - np.tensordot(found.alone, shapes, axes=1)
    return float(np.linalg.norm(left - left.mean(axis=0), axis=2).mean())


def _from_neutral(scene: Scene, neutral_mm: np.ndarray) -> np.ndarray:
    """Offsets (F, L, 3) of the lips' L vertices from neutral_mm (V, 3), head frame, mm."""
    lips = np.stack([scene.local_mm(row)[scene.lips] for row in scene.take.rows])
    return lips - neutral_mm[scene.lips]


def run(arguments: argparse.Namespace) -> None:
    """Print a line a take and neutral."""
    names, rows = [arguments.take], []
    if arguments.take == ALL:
        found = sorted(arguments.results.glob("apply/*/*/corrected.npy"))
        names = ["/".join(path.parent.parts[-2:]) for path in found]
    studio = FaceModel.load(arguments.results / "face_model" / "studio.npz")
    for name in names:
        scene = Scene.of(FinishedRun.of(argparse.Namespace(**vars(arguments) | {"take": name})))
        rig = shapes_on_coarse(studio, scene.face)
        count = len(scene.take.rows)
        rows += [
            {"take": name, "frames": count, "neutral": kind, **figures(scene, rig, neutral)}
            for kind, neutral in scene.neutrals()
        ]
    print_table(rows, 2)
