"""Lip error of a video of an unseen person, whose only truth is a sequence of meshes.

Such a person has no rig take, so no **H** says which point of the truth a vertex of the track belongs to.
Here the tracker's general model is laid over the truth's neutral as over a scan (`scan.personal`); each
vertex belongs to the point of the neutral that it comes to lie on, and is followed through the frames.
The neutral's landmarks are the vertices that the studio's model names, where the truth is in its vertex
order; else give them (`--landmarks`, the table of docs/scan.md).

Rows: `base`, the track; `null`, its lips along the contours in the image with nothing learnt, which is
`apply.regressor: none` too; and each regressor of `--models`. Measures are those of docs/measures.md over
all tracked frames, after a rigid alignment a frame on the face outside the mouth:

- `motion`: lip_motion_error_mm, over the vermilion; `mouth`: vertex_error_mean_mm over the mouth;
- `mouth_own`: the mouth after an alignment on the mouth itself; `lip_shape`: lip_shape_error_mm;
- `opening`: aperture_error_mm; `jitter`: jitter_mm over the vermilion.

With `--parts`, where the motion error comes from: `size`, true over tracked size of the face outside the
mouth; `motion_sized`, the motion error once the whole track has that size; `motion_own`, after an
alignment a frame on the mouth itself, which takes away jaw, pose and drift; `across` and `up` (in the
head frame), `depth`: its parts along the head's axes; `static`: the mean offset that is no motion.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.common import add_run_arguments, print_table
from benchmarks.finished_run import FinishedRun
from vermilion.baselines.null import null_model
from vermilion.config.correction import CorrectionConfig
from vermilion.config.correspondence import CorrespondenceConfig
from vermilion.config.evaluation import MeasuresConfig, ReferenceConfig
from vermilion.config.load import read_keys
from vermilion.correction.coarse_take import CoarseTake
from vermilion.correction.correct import CorrectionSettings, correct
from vermilion.correspondence.correspondence import CorrespondenceSettings
from vermilion.correspondence.neutral import model_mouth_mask
from vermilion.evaluation.lips import LipTolerances
from vermilion.evaluation.masks import Regions, regions_of_mask
from vermilion.evaluation.measures import measure_rows
from vermilion.evaluation.reference import MatchTolerance, Reference, reference_of
from vermilion.evaluation.take import TakeResult, evaluate_take
from vermilion.evaluation.truth import read_truth
from vermilion.faces.model import FaceModel
from vermilion.geometry.alignment import align_frames, similarity_alignment
from vermilion.geometry.closest_points import Surface
from vermilion.geometry.mesh import Mesh, vertex_normals
from vermilion.regression.model import LipModel, load_model
from vermilion.scan.landmarks import ScanLandmarks, read_scan_landmarks
from vermilion.scan.personal import personal_model
from vermilion.storage.arrays import read_arrays
from vermilion.storage.errors import InputError

#: Column -> measure and region.
SHOWN = {
    "motion": ("lip_motion_error_mm", "vermilion"),
    "ratio": ("lip_motion_ratio", "vermilion"),
    "mouth": ("vertex_error_mean_mm", "mouth"),
    "lip_shape": ("lip_shape_error_mm", "vermilion"),
    "opening": ("aperture_error_mm", "mouth"),
    "jitter": ("jitter_mm", "vermilion"),
}
#: A registration that leaves more is of another head or pose.
_FAR_MM = 1.0


@dataclass(frozen=True)
class UnseenSubjectTruth:
    """Truth of a take: neutral (S, 3), frames (F, S, 3), mm, triangles (T, 3), its 66 landmarks."""

    neutral_mm: np.ndarray
    vertices_mm: np.ndarray
    triangles: np.ndarray
    landmarks: ScanLandmarks

    def reference(self, generic: FaceModel, slight_open: float, near: MatchTolerance) -> Reference:
        """The truth's point of each vertex of the tracker's topology, followed through the frames.

        Args:
            generic: the tracker's general model, V vertices.
            slight_open: weight of jawOpen in its neutral.
            near: what counts as the same place once the model lies on the truth's neutral.

        Raises:
            InputError: the model does not come to lie on the neutral.
        """
        made = personal_model(
            generic, Mesh(self.neutral_mm, self.triangles), self.landmarks,
            unit_mm=1.0, least_opening=-slight_open,
        )  # fmt: skip
        away_mm = made.figures()["distance_mean_mm"]
        if away_mm > _FAR_MM:
            raise InputError(
                f"a model that lies {away_mm:.1f} mm from the truth's neutral after registration",
                f"under {_FAR_MM} mm",
                "Give landmarks of the truth's neutral in its own frame (--landmarks).",
            )
        laid, surface = made.registered, Surface(made.scan.vertices_mm, self.triangles)
        normals = vertex_normals(laid.vertices_mm, laid.triangles)
        found = surface.closest(laid.vertices_mm, normals, near.min_cosine)
        where = found.within(near.max_distance_mm)
        return reference_of("truth", where, self.vertices_mm, self.triangles, self.neutral_mm)


def truth_of(
    run: FinishedRun, frames: np.ndarray, first: int, landmarks: Path | None
) -> UnseenSubjectTruth:
    """The truth of the `frames` (F,) of a take that begins with frame `first`."""
    vertices, triangles = read_truth(
        run.truth / "vertices_mm.npy", run.truth / "triangles.npy", frames - first
    )
    neutral = np.load(run.truth / "neutral_mm.npy").astype(np.float64)
    if landmarks is not None:
        return UnseenSubjectTruth(neutral, vertices, triangles, read_scan_landmarks(landmarks))
    ids = run.model("studio").landmarks
    if ids.max() >= len(neutral):
        raise InputError(
            f"a neutral of {len(neutral)} vertices",
            "the vertex order of the studio's model, whose landmarks are known",
            "Give the neutral's landmarks (--landmarks).",
            path=run.truth,
        )
    return UnseenSubjectTruth(
        neutral, vertices, triangles, ScanLandmarks(neutral[ids], np.zeros(66))
    )


def tracked_take(run: FinishedRun, model: FaceModel) -> CoarseTake:
    """The tracked frames of the run's take."""
    fit, folder = run.fit(), run.folder
    return CoarseTake.load(
        model, fit, run.identity().neutral_mm, sorted((folder / "tracking" / "C").glob("0*.npy")),
        sorted((folder / "features").glob("0*.npz")), fit.frames[fit.valid],
    )  # fmt: skip


def sequences_of(
    take: CoarseTake, models: Mapping[str, LipModel], options: CorrectionConfig, fps: float
) -> dict[str, np.ndarray]:
    """Regressor -> (F, V, 3) mm: the track as `base`, and what each model makes of it."""
    settings = CorrectionSettings.of(options.at(fps))
    return {"base": take.coarse_mm} | {
        name: correct(model, take, settings) for name, model in models.items()
    }


def evaluated(
    sequences: Mapping[str, np.ndarray],
    frames: np.ndarray,
    model: FaceModel,
    regions: Regions,
    against: Reference,
) -> TakeResult:
    """Measures of sequences (F, V, 3) of the `frames` (F,)."""
    options = MeasuresConfig()
    tolerances = LipTolerances(options.touch_mm, options.gape_mm, options.through_mm)
    return evaluate_take(
        dict(sequences), frames, model, regions, against, options.clip_frames, options.min_clips,
        tolerances,
    )  # fmt: skip


def figures(
    sequences: Mapping[str, np.ndarray],
    frames: np.ndarray,
    model: FaceModel,
    regions: Regions,
    against: Reference,
) -> list[dict[str, float | str]]:
    """A row a regressor: the measures of `SHOWN`, and `mouth_own`."""
    result = evaluated(sequences, frames, model, regions, against)
    options = MeasuresConfig()
    table = measure_rows(
        result.sums, "-", "-", len(frames), options.bootstrap_samples, options.confidence, options.seed
    )  # fmt: skip
    table = table.set_index(["regressor", "measure", "region"])["value"]
    mouth = regions.restricted(against.valid).weights["mouth"]
    rows: list[dict[str, float | str]] = []
    for name, sequence in sequences.items():
        values = {column: table.get((name, *key), np.nan) for column, key in SHOWN.items()}
        own = align_frames(sequence, against.points_mm, mouth).apply(sequence) - against.points_mm
        rows.append({"regressor": name, **values, "mouth_own": _mean_length(own, mouth)})
    return rows


def parts(
    sequences: Mapping[str, np.ndarray], model: FaceModel, regions: Regions, against: Reference
) -> list[dict[str, float | str]]:
    """A row a regressor: what the motion error consists of, see above."""
    regions = regions.restricted(against.valid)
    rest, lips, mouth = regions.rest, regions.weights["vermilion"], regions.weights["mouth"]
    head = align_frames(against.points_mm, model.neutral_mm, rest).rotations

    def moving(sequence: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        aligned = align_frames(sequence, against.points_mm, weights).apply(sequence)
        offset = (aligned - against.points_mm) @ np.swapaxes(head, 1, 2)
        return offset - offset.mean(axis=0), offset.mean(axis=0)

    rows: list[dict[str, float | str]] = []
    for name, sequence in sequences.items():
        known = rest > 0
        centred = [
            (s[:, known] - s[:, known].mean(axis=1, keepdims=True)).reshape(-1, 3)
            for s in (align_frames(sequence, against.points_mm, rest).apply(sequence), against.points_mm)
        ]  # fmt: skip
        weights = np.tile(rest[known], len(sequence))
        size = similarity_alignment(*centred, weights).scale
        error, static = moving(sequence, rest)
        sized = moving(size * sequence, rest)[0]
        row: dict[str, float | str] = {
            "regressor": name,
            "size": size,
            "motion": _mean_length(error, lips),
            "motion_sized": _mean_length(sized, lips),
            "motion_own": _mean_length(moving(sequence, mouth)[0], lips),
        }
        for axis, part in enumerate(("across", "up", "depth")):
            row[part] = _mean_length(error[..., axis : axis + 1], lips)
        rows.append(row | {"static": _mean_length(static[None], lips)})
    return rows


def _mean_length(errors: np.ndarray, weights: np.ndarray) -> float:
    """Mean length of errors (F, V, d) by weights (V,) of the vertices, mm."""
    lengths = np.nan_to_num(np.linalg.norm(errors, axis=2)) @ weights
    return float(lengths.mean() / weights.sum())


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What is read."""
    add_run_arguments(parser, "face/phone")
    parser.add_argument("--config", type=Path, help="of the run (default: config.yaml in it)")
    parser.add_argument(
        "--models", type=Path, nargs="+", default=[], metavar="FILE", help="trained regressors"
    )
    parser.add_argument("--fps", type=float, default=30.0, help="of the take (%(default)s)")
    parser.add_argument(
        "--landmarks", type=Path, metavar="FILE", help="landmarks of the truth's neutral"
    )
    parser.add_argument("--parts", action="store_true", help="print parts of the motion error")


def run(arguments: argparse.Namespace) -> None:
    """Measure and print."""
    finished = FinishedRun.of(arguments)
    written = finished.results / "config.yaml"
    path = arguments.config or (written if written.is_file() else None)
    keys = read_keys(path) if path else {}
    region = CorrespondenceConfig(**keys.get("correspondence", {}))
    near = ReferenceConfig(**keys.get("evaluation", {}).get("reference", {}))
    slight_open = keys.get("face_model", {}).get("template_slight_open", 0.09)
    model = finished.tracker_model()
    take = tracked_take(finished, model)
    mask = model_mouth_mask(
        model,
        take.neutral_mm,
        CorrespondenceSettings(**region.model_dump(exclude={"landmarks"})),
    )
    regions = regions_of_mask(model, take.neutral_mm, mask)
    first = int(finished.fit().frames[0])
    truth = truth_of(finished, take.frames, first, arguments.landmarks)
    against = truth.reference(
        finished.model("tracker"), slight_open, MatchTolerance(**near.model_dump())
    )
    features = sorted((finished.folder / "features").glob("0*.npz"))
    names = read_arrays(features[0], "features", ["names"])["names"].tolist()
    models = {"null": null_model(model.triangles, mask, names)}
    models |= {file.stem: load_model(file) for file in arguments.models}
    options = CorrectionConfig(**_without(keys.get("correction", {}), "neutral_frames"))
    sequences = sequences_of(take, models, options, arguments.fps)
    print(
        f"{finished.take}: {len(take)} frames, focal {finished.fit().camera.calibration[0, 0]:.0f} px"
    )
    print_table(figures(sequences, take.frames, model, regions, against))
    if arguments.parts:
        print_table(parts(sequences, model, regions, against), {"size": 4})


def _without(section: Mapping, *names: str) -> dict:
    return {key: value for key, value in section.items() if key not in names}
