"""The top of the summary page: the video beside its result, and three figures with a sentence each."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from vermilion.report import page


def shown_regressor(headline: pd.DataFrame, applied: str) -> str:
    """The row of the headline that the figures are of; empty where there is none.

    Args:
        headline: of `headline.headline`.
        applied: kind of the regressor that corrected the first video (PS, MS, GR); may be empty. Where it
            was not measured, the first one that was held against one that learnt nothing.
    """
    names = headline["regressor"].tolist()
    if applied in names:
        return applied
    held = headline.loc[headline["null"].fillna("") != "", "regressor"].tolist()
    return held[0] if held else ""


def three_figures(
    headline: pd.DataFrame, flagged: pd.DataFrame, total: int, applied: str
) -> list[tuple[str, str, str]]:
    """(figure, what it is, sentence): motion of the lips, opening of the mouth, frames that could be used.

    Args:
        headline: of `headline.headline`; flagged: rows of `quality.tsv`.
        total: frames of all takes.
        applied: as in `shown_regressor`.
    """
    found, name = [], shown_regressor(headline, applied)
    if name:
        rows = headline.set_index("regressor")
        for column, what in (
            ("lip_motion_mm", "the lips' motion"),
            ("aperture_mm", "the mouth's opening"),
        ):
            figure = f"{rows.loc[name, column]:.2f} mm"
            found.append((figure, f"error of {what}, {name}", _others(rows, name, column)))
    lost = flagged[flagged["valid"] == 0].drop_duplicates(["subject", "take", "frame"])
    share = 100 * (1 - len(lost) / max(total, 1))
    found.append(
        (
            f"{np.floor(share):.0f} %",
            "of the frames were used by every stage",
            f"{len(lost)} of {total} frames could not be used somewhere; "
            f"{len(flagged)} remarks are listed below under Flagged frames.",
        )
    )
    return found


def _others(rows: pd.DataFrame, name: str, column: str) -> str:
    """What the track, a regressor that learnt nothing and, where they are better, the contours reach."""
    row = rows.loc[name]
    said = f"The track alone is {rows.loc['base', column]:.2f} mm off"
    if row["null"] in rows.index:
        said += f", one that learnt nothing {rows.loc[row['null'], column]:.2f} mm"
    said += "."
    if column == "lip_motion_mm":
        said += _of_learning(row)
    if "contour" in rows.index and rows.loc["contour", column] < row[column]:
        said += f" Contours without a regressor reach {rows.loc['contour', column]:.2f} mm."
    return said


def _of_learning(row: pd.Series) -> str:
    """What of the motion's error is owed to learning."""
    change = 100 * (1 - row["over_null"])
    return {
        "better": f" Learning takes away {change:.0f} %.",
        "worse": f" What was learnt makes it {-change:.0f} % worse.",
        "level": " Learning is not shown to help.",
    }.get(row["answer"], "")


def beside(
    videos: Sequence[tuple[str, Path]],
    timelines: Sequence[tuple[str, Path]],
    limit_mb: float,
    folder: Path,
) -> str:
    """The first corrected video beside its original, the others folded; `folder` of the page."""
    shown = [page.video(path, _VIDEO.format(name), limit_mb, folder) for name, path in videos]
    drawn = [page.image(path, _TIMELINE.format(name), folder) for name, path in timelines]
    if not shown:
        return ""
    body = shown[0]
    if len(shown) > 1:
        body += page.folded(f"{len(shown) - 1} more", "".join(shown[1:]))
    return body + (page.folded("How far from the training", "".join(drawn)) if drawn else "")


_VIDEO = "{}: original, base track, corrected; below, the mouth."
_TIMELINE = (
    "{}: how far each frame lies from what the regressor was trained on, and the limit over which it "
    "is listed below as outside the training's span; grey frames were not corrected."
)
