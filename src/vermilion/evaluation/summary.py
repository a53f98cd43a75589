"""The summary page: every result on one HTML page that opens offline."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from vermilion import page
from vermilion.evaluation.mouth_kinds import KINDS
from vermilion.evaluation.table1 import in_order, place_of

FRAME_COLUMNS = ("take", "role", "frames", "held_out", "against")
_STAGES = (
    "capture", "multiview", "inpaint", "landmarks", "tracking", "contours", "features",
    "correspondence", "correction", "evaluation", "apply",
)  # fmt: skip


@dataclass(frozen=True)
class Overlay:
    """A picture of a stage: stage, `subject/take` (or what it shows), file."""

    stage: str
    what: str
    path: Path


@dataclass(frozen=True)
class Findings:
    """What the page shows.

    Attributes:
        measures, table1, kinds, flagged: tables.
        table1_picture: file.
        error_maps, over_time, curve_pictures: (name, file) pairs.
        overlays: pictures of the stages.
        videos, timelines: (name, file) pairs of the corrected takes.
        frames: a row a take: take, role, frames, held_out, against.
        settings: (what, value) pairs for "How this was measured".
    """

    measures: pd.DataFrame
    table1: pd.DataFrame
    kinds: pd.DataFrame
    flagged: pd.DataFrame
    table1_picture: Path
    error_maps: Sequence[tuple[str, Path]]
    over_time: Sequence[tuple[str, Path]]
    curve_pictures: Sequence[tuple[str, Path]]
    overlays: Sequence[Overlay]
    videos: Sequence[tuple[str, Path]]
    timelines: Sequence[tuple[str, Path]]
    frames: pd.DataFrame
    settings: Sequence[tuple[str, str]]


def summary_page(found: Findings, embed_video_mb: float) -> str:
    """The page as one string of HTML with everything embedded."""
    takes = len(found.frames)
    total = int(found.frames["frames"].sum()) if takes else 0
    return page.page(
        "Lips: what was built and how accurate it is",
        f"{takes} takes, {total} frames. Everything on this page is also a TSV file beside it.",
        [
            ("Key figures", _key_figures(found)),
            ("Table 1: tracking error", _table1(found)),
            ("Corrected takes", _videos(found, embed_video_mb)),
            ("Error maps", "".join(page.picture(p, _MAP_CAPTION.format(n)) for n, p in found.error_maps)),
            ("Over time", "".join(page.picture(p, f"{n}: held-out frames.") for n, p in found.over_time)),
            ("Kinds of mouth shapes", _kinds(found.kinds)),
            ("Further measures", _further(found.measures)),
            ("Accuracy of H", _reconstruction(found.measures)),
            ("Training", "".join(page.picture(p, f"{n}: cross-validation error.") for n, p in found.curve_pictures)),
            ("Flagged frames", _flagged(found)),
            ("Pictures of every stage", _stages(found.overlays)),
            ("How this was measured", _how(found)),
        ],
    )  # fmt: skip


_TIMELINE_CAPTION = (
    "{}: how far each frame lies from what the regressor was trained on, and the limit over which it "
    "is listed below as outside the training's span; grey frames were not corrected."
)
_MAP_CAPTION = (
    "{}: distance of each vertex to its corresponding point, held-out frames with the largest error "
    "of the base track; grey is not measured."
)


def _key_figures(found: Findings) -> str:
    items = []
    rows = _together(found.table1).set_index("regressor")
    for name in in_order(rows.index):
        row = rows.loc[name]
        if name == "base":
            items.append((f"{row['mean_mm']:.2f} mm", "base track, mean error over the mouth"))
        else:
            ratio = f"{row['ratio_to_base']:.2f}"
            items.append((ratio, f"of base: {name} ({row['mean_mm']:.2f} mm)"))
    h = _value(found.measures, "surface_error_median_mm", "vermilion", "H")
    if h is not None:
        items.append((f"{h:.2f} mm", "H, median surface error over the vermilion"))
    items.append((str(len(found.flagged)), "flagged frames, all stages"))
    return page.figures(items)


def _table1(found: Findings) -> str:
    if found.table1.empty:
        return '<p class="none">No take has held-out frames.</p>'
    rows = found.table1.copy()
    rows["where"] = [place_of(s, t) for s, t in zip(rows["subject"], rows["take"], strict=True)]
    headings = {
        "where": "take", "regressor": "regressor", "mean_mm": "mean, mm", "low_mm": "low",
        "high_mm": "high", "std_mm": "deviation, mm", "ratio_to_base": "of base",
        "ratio_low": "low", "ratio_high": "high", "base_mm": "base on the same frames, mm",
        "frames": "frames",
    }  # fmt: skip
    caption = (
        "Mean vertex error over the mouth mask on held-out frames, area-weighted, with the interval "
        "over clips. Lips16 reports 4.0 mm for its base tracker and 3.3, 3.0 and 3.2 mm for PS, MS "
        "and GR on its own data."
    )
    return page.table(rows, headings, "where") + page.picture(found.table1_picture, caption)


def _kinds(kinds: pd.DataFrame) -> str:
    rows = kinds[(kinds["region"] == "mouth")].reset_index(drop=True)
    if rows.empty:
        return ""
    headings = {
        "kind": "kind", "regressor": "regressor", "mean_mm": "mean, mm", "low_mm": "low",
        "high_mm": "high", "ratio_to_base": "of base", "ratio_low": "low", "ratio_high": "high",
        "frames": "frames", "clips": "clips",
    }  # fmt: skip
    order = rows["kind"].map({kind: k for k, kind in enumerate(KINDS)})
    rows = rows.iloc[np.argsort(order, kind="stable")]
    rows = rows[~rows["regressor"].str.contains("/")]
    note = (
        "<p>Mean vertex error over the mouth mask by kind of mouth shape, all takes together. The vermilion "
        "alone, and variants, are in <code>kinds.tsv</code>.</p>"
    )
    return note + page.table(rows, headings, "kind")


def _further(measures: pd.DataFrame) -> str:
    rows = _together(measures)
    rows = rows[rows["regressor"] != "H"]
    if rows.empty:
        return ""
    wide = rows.pivot_table(
        index=["region", "measure", "unit"], columns="regressor", values="value", sort=False
    )
    wide = wide[in_order(wide.columns)].reset_index()
    headings = {"region": "region", "measure": "measure", "unit": "unit"}
    headings |= {name: name for name in in_order(rows["regressor"])}
    note = "<p>All takes together; each take by itself is in <code>measures.tsv</code>.</p>"
    return note + page.table(wide, headings, "region")


def _reconstruction(measures: pd.DataFrame) -> str:
    rows = measures[measures["regressor"] == "H"]
    if rows.empty:
        return '<p class="none">No tattoo take has known truth to hold H against.</p>'
    rows = rows.assign(where=rows["subject"] + "/" + rows["take"])
    headings = {
        "where": "take", "region": "region", "measure": "measure", "value": "value",
        "low": "low", "high": "high", "unit": "unit", "frames": "frames",
    }  # fmt: skip
    return (
        "<p>The multi-view reconstruction itself against known truth, in the rig's world, without "
        "any alignment.</p>" + page.table(rows, headings, "where")
    )


def _videos(found: Findings, limit_mb: float) -> str:
    caption = "{}: original, base track, corrected; below, the mouth."
    videos = "".join(
        page.video(path, caption.format(name), limit_mb) for name, path in found.videos
    )
    return videos + "".join(
        page.picture(path, _TIMELINE_CAPTION.format(name)) for name, path in found.timelines
    )


def _flagged(found: Findings) -> str:
    if found.flagged.empty:
        return '<p class="none">None.</p>'
    rows = found.flagged.assign(where=found.flagged["subject"] + "/" + found.flagged["take"])
    counts = (
        rows.groupby(["stage", "where", "reason"], sort=False)["frame"]
        .agg(["count", lambda frames: page.spans(frames.tolist())])
        .set_axis(["count", "which"], axis=1)
        .reset_index()
    )
    headings = {
        "stage": "stage", "where": "take", "count": "frames", "which": "which", "reason": "reason"
    }  # fmt: skip
    return page.table(counts, headings, "stage")


def _stages(overlays: Sequence[Overlay]) -> str:
    body = ""
    for stage in sorted({o.stage for o in overlays}, key=_rank):
        of_stage = [o for o in overlays if o.stage == stage]
        pictures = "".join(page.picture(o.path, o.what) for o in of_stage)
        body += page.folded(f"{stage} ({len(of_stage)})", pictures)
    return body


def _rank(stage: str) -> tuple[int, str]:
    return (_STAGES.index(stage) if stage in _STAGES else len(_STAGES), stage)


def _how(found: Findings) -> str:
    frames = page.table(
        found.frames,
        {"take": "take", "role": "role", "frames": "frames", "held_out": "held out",
         "against": "measured against"},
    )  # fmt: skip
    settings = pd.DataFrame(found.settings, columns=["what", "value"])
    return _HOW + frames + page.table(settings, {"what": "setting", "value": "value"})


_HOW = """
<p><b>Frames.</b> Only frames that the take sheet holds out are measured; no regressor saw them, nor did
the choice of its parameters. Frames that were not tracked are left out and listed above.</p>
<p><b>Correspondence.</b> A vertex of the coarse mesh C belongs to a point of H (found once a person, on
the neutral). Where truth is known, that point goes on to the nearest point of the truth's neutral that
faces the same way and is not on the other lip, and is then followed through the truth's frames. Vertices
without such a point are not measured. Where no truth is known, the held-out H takes its place.</p>
<p><b>Alignment.</b> One rigid motion a frame, without scale, brings the base track onto the truth: area-
weighted least squares over the face outside the mouth mask. All corrections of the frame share it, so
that they differ from the base by their correction alone. H is measured without alignment.</p>
<p><b>Regions.</b> <i>mouth</i>: the triangles of the correction layer; <i>vermilion</i>: the red of both
lips; <i>face</i>: the face. The inside of the mouth is in none of them. Every mean, deviation and
percentile is weighted by the area of the neutral.</p>
<p><b>Measures.</b> Vertex error: distance to the corresponding point. Surface error: distance to the
nearest point of the true surface. Gap: lowest point of the upper lip less highest point of the lower, in
seven columns of the middle half of the mouth, in the head frame. Jitter: mean second difference over
time, less that of the truth. Contour error: distance of contour points found in the picture to the
projected contours of the mesh, per inter-ocular distance. Feature error: RMS of regressed against true
layer entries.</p>
<p><b>Kinds of mouth shapes.</b> By the true expression weights where they are known, each over a threshold
(pucker or funnel, rolls, presses, jaw, smiles), else by width, gap, height of the red and protrusion of the
reference's lips against its neutral; speech is what lies between.</p>
<p><b>Intervals.</b> Percentile bootstrap over clips of consecutive frames; every regressor is measured on
the same draws, so that ratios compare like with like. With one clip there is no interval.</p>
"""


def _together(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows of all takes together."""
    return rows[(rows["subject"] == "all") & (rows["take"] == "all")]


def _value(measures: pd.DataFrame, measure: str, region: str, regressor: str) -> float | None:
    rows = _together(measures)
    rows = rows[
        (rows["measure"] == measure) & (rows["region"] == region) & (rows["regressor"] == regressor)
    ]
    return None if rows.empty else float(rows["value"].iloc[0])
