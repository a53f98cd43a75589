"""Inner lips against borders that a person drew on frames of a real video.

A folder of labels holds a file a frame, `<frame:06d>.json`: `{"unit": "px", "upper": [[x, y], ...], "lower":
[[x, y], ...]}`, the borders between lip and whatever is not lip, each from the right corner of the mouth to
the left one. Prints, for the landmarks, the found contours, the base track and the corrected meshes:

- `inner`: mean distance in px at a mouth width of 120 px between drawn and found border, both ways, over the
  middle 80 % of the mouth; its upper and lower lip; the worst frame;
- `opening`: mean height of the middle half of the mouth as a share of the drawn one, median, least and most
  over frames that are drawn open by more than 4 px;
- `closed`: mean height in px of the other frames, less the drawn.

A mesh's border is the visible one of its opening, by ray casting (`visible_opening`). With a
second folder of labels of the same frames, the difference of the two is printed as well.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.common import add_run_arguments, print_table
from benchmarks.finished_run import FinishedRun
from benchmarks.visible_opening import VisibleOpening
from vermilion.contours.landmark_rings import LandmarkRings
from vermilion.evaluation.contour_error import distance_to_polyline
from vermilion.features.vector import FeatureTable
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.storage.errors import InputError
from vermilion.storage.sequences import read_sequence

WIDTH_PX, OPEN_PX, COLUMNS = 120.0, 4.0, 41
#: Shares of the mouth's width left out at either corner, of the error and of the opening.
_ENDS, _SIDES = 0.1, 0.25


@dataclass(frozen=True)
class DrawnLips:
    """Inner borders of the lips in an image: upper and lower (n, 2) px, right corner to left."""

    upper: np.ndarray
    lower: np.ndarray

    @classmethod
    def read(cls, path: Path) -> DrawnLips:
        """Read a label. Raises InputError where it is none."""
        try:
            data = json.loads(path.read_text())
            return cls(*(np.asarray(data[name], dtype=float) for name in ("upper", "lower")))
        except (ValueError, KeyError, TypeError) as error:
            raise InputError(
                f"no label ({error})", '{"unit": "px", "upper": [[x, y], ...], "lower": ...}',
                "Draw it again, or remove the file.", path=path,
            ) from error  # fmt: skip

    @property
    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """The corners (2,) of the mouth."""
        return self.upper[0], self.upper[-1]

    def borders(self) -> np.ndarray:
        """The borders in `COLUMNS` columns between the corners, (2, COLUMNS, 2)."""
        return columns_of(self.upper, self.lower, *self.ends)


def columns_of(
    upper: np.ndarray, lower: np.ndarray, start: np.ndarray, end: np.ndarray
) -> np.ndarray:
    """Borders `upper` and `lower` (n, 2) in columns across the line from `start` to `end` (2,), (2, COLUMNS, 2)."""
    along = (end - start) / np.linalg.norm(end - start)
    down = np.array([-along[1], along[0]])
    places = np.arange(1, COLUMNS + 1) / (COLUMNS + 1) * np.linalg.norm(end - start)
    result = []
    for line in (upper, lower):
        x, y = (line - start) @ along, (line - start) @ down
        order = np.argsort(x)
        heights = np.interp(places, x[order], y[order])
        result.append(start + places[:, None] * along + heights[:, None] * down)
    return np.stack(result)


def halves(ring: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Upper and lower border of an inner ring (n, 2) with the corners at 0 and n / 2."""
    half = len(ring) // 2
    return ring[: half + 1], np.concatenate([ring[half:], ring[:1]])[::-1]


def compare(found: np.ndarray, drawn: np.ndarray, scale: float) -> dict[str, float]:
    """Figures of a frame: borders found and drawn, (2, COLUMNS, 2) px; `scale` to the standard width."""
    share = np.arange(1, COLUMNS + 1) / (COLUMNS + 1)
    middle = (share >= _ENDS) & (share <= 1 - _ENDS)
    lips = []
    for a, b in zip(found, drawn, strict=True):
        away = distance_to_polyline(a[middle], b, False), distance_to_polyline(b[middle], a, False)
        lips.append(scale * 0.5 * (np.nanmean(away[0]) + np.nanmean(away[1])))
    half = (share >= _SIDES) & (share <= 1 - _SIDES)
    gaps = [
        scale * np.linalg.norm(np.diff(v[:, half], axis=0)[0], axis=1).mean()
        for v in (found, drawn)
    ]
    return {
        "inner": float(np.mean(lips)),
        "upper": lips[0],
        "lower": lips[1],
        "gap": gaps[0],
        "drawn": gaps[1],
    }


Finder = Callable[[int, DrawnLips], np.ndarray | None]


def finders(run: FinishedRun, corrected: Path | None) -> dict[str, Finder]:
    """Name -> function (frame, its label) -> borders (2, COLUMNS, 2), None where there are none."""
    fit, opening = run.fit(), VisibleOpening.of(run.tracker_model())
    rings = LandmarkRings(
        LandmarkTrack.load(sorted((run.folder / "landmarks").glob("0*.npz")), None)
    )
    tables = [FeatureTable.load(path) for path in sorted((run.folder / "features").glob("*.npz"))]
    inner = {int(f): t.inner_px[i] for t in tables for i, f in enumerate(t.frames) if t.valid[i]}

    def of_ring(ring: np.ndarray | None, label: DrawnLips) -> np.ndarray | None:
        return None if ring is None else columns_of(*halves(ring), *label.ends)

    def of_mesh(sequence: np.ndarray) -> Finder:
        def find(frame: int, label: DrawnLips) -> np.ndarray | None:
            row = int(fit.index_of([frame])[0])
            if not fit.valid[row]:
                return None
            return opening.borders(
                np.asarray(sequence[row], float), fit.camera, *label.ends, COLUMNS
            )

        return find

    found: dict[str, Finder] = {
        "landmarks": lambda frame, label: of_ring((rings(frame) or (None, None))[1], label),
        "contours": lambda frame, label: of_ring(inner.get(frame), label),
        "base": of_mesh(run.coarse_mm()),
    }
    if corrected is not None:
        found["corrected"] = of_mesh(read_sequence([corrected]))
    return found


def measure(
    labels: dict[int, DrawnLips], found: dict[str, Finder], width_px: float
) -> pd.DataFrame:
    """A row a kind and frame."""
    rows = []
    for name, find in found.items():
        for frame, label in labels.items():
            borders = find(frame, label)
            row = {"kind": name, "frame": frame}
            rows.append(
                row
                if borders is None
                else row | compare(borders, label.borders(), WIDTH_PX / width_px)
            )
    return pd.DataFrame(rows)


def summary(table: pd.DataFrame) -> pd.DataFrame:
    """A row a kind."""
    rows = []
    for name, part in table.groupby("kind", sort=False):
        wide = part[part.drawn > OPEN_PX]
        shares, shut = wide.gap / wide.drawn, part[part.drawn <= OPEN_PX]
        rows.append({
            "kind": name, "frames": int(part.inner.notna().sum()), "missing": int(part.inner.isna().sum()),
            "inner": part.inner.mean(), "upper": part.upper.mean(), "lower": part.lower.mean(),
            "median": part.inner.median(), "worst": part.inner.max(), "opening": shares.median(),
            "least": shares.min(), "most": shares.max(), "closed": (shut.gap - shut.drawn).mean(),
        })  # fmt: skip
    return pd.DataFrame(rows)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What is read."""
    add_run_arguments(parser, "address/address", truth=False)
    parser.add_argument(
        "--labels", type=Path, required=True, metavar="FOLDER", help="folder of labels"
    )
    parser.add_argument(
        "--again", type=Path, metavar="FOLDER", help="the same frames drawn a second time"
    )
    parser.add_argument(
        "--corrected", type=Path, metavar="FILE", help="corrected meshes of the take (.npy)"
    )
    parser.add_argument("--frames", type=int, nargs="+", help="only these frames")
    parser.add_argument("--each", action="store_true", help="print each frame as well")


def run(arguments: argparse.Namespace) -> None:
    """Measure and print."""
    asked = arguments.frames
    paths = {int(path.stem): path for path in sorted(arguments.labels.glob("*.json"))}
    labels = {f: DrawnLips.read(path) for f, path in paths.items() if asked is None or f in asked}
    if not labels:
        raise InputError(
            "no labels",
            "files <frame:06d>.json",
            "Draw some, or correct --labels.",
            path=arguments.labels,
        )
    width = float(
        np.median([np.linalg.norm(np.subtract(*label.ends)) for label in labels.values()])
    )
    finished = FinishedRun.of(arguments)
    corrected = arguments.corrected
    if corrected is None:
        written = finished.results / "apply" / finished.take / "corrected.npy"
        corrected = written if written.exists() else None
    found = finders(finished, corrected)
    if arguments.again is not None:
        second = {f: DrawnLips.read(arguments.again / paths[f].name) for f in labels}
        found["drawn again"] = lambda frame, label: columns_of(
            second[frame].upper, second[frame].lower, *label.ends
        )
    table = measure(labels, found, width)
    if arguments.each:
        print_table(table)
    print_table(summary(table))
