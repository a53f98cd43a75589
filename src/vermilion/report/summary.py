"""The summary page: every result on one HTML page that opens offline."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from vermilion.config.regressors import in_order, is_variant
from vermilion.report import lips16_sections, page
from vermilion.report.headline import learning_sentences
from vermilion.report.how_measured import how_measured
from vermilion.report.overview import beside, three_figures
from vermilion.report.table1 import place_of

FRAME_COLUMNS = ("take", "role", "frames", "split", "train", "held_out", "against")
REGRESSOR_COLUMNS = ("regressor", "trained_on", "frames", "measured_on")
_STAGES = (
    "capture", "multiview", "inpaint", "landmarks", "scan", "tracking", "detail",
    "contours", "features", "correspondence", "correction", "guided",
)  # fmt: skip


@dataclass(frozen=True)
class Overlay:
    """An image of a stage: stage, `subject/take` (or what it shows), file."""

    stage: str
    what: str
    path: Path


@dataclass(frozen=True)
class SummaryInputs:
    """What the page shows.

    Attributes:
        measures, headline, table1, kinds, flagged: tables.
        comparisons, table2, table3, estimators: tables; configured: the estimator of the configuration.
        applied: kind of the regressor that corrected the first video, or empty.
        table1_image, figure16: files.
        renders, stretch, error_maps, over_time, curve_images: (name, file) pairs.
        reconstructions: (name, link) pairs, pages on H of a take.
        overlays: images of the stages.
        videos, timelines: (name, file) pairs of the corrected takes.
        frames, regressors: tables of `how_measured`.
        settings: (what, value) pairs for "How this was measured".
    """

    measures: pd.DataFrame
    headline: pd.DataFrame
    table1: pd.DataFrame
    kinds: pd.DataFrame
    flagged: pd.DataFrame
    comparisons: pd.DataFrame
    table2: pd.DataFrame
    table3: pd.DataFrame
    estimators: pd.DataFrame
    configured: str
    applied: str
    table1_image: Path
    figure16: Path
    renders: Sequence[tuple[str, Path]]
    stretch: Sequence[tuple[str, Path]]
    error_maps: Sequence[tuple[str, Path]]
    over_time: Sequence[tuple[str, Path]]
    curve_images: Sequence[tuple[str, Path]]
    overlays: Sequence[Overlay]
    videos: Sequence[tuple[str, Path]]
    timelines: Sequence[tuple[str, Path]]
    reconstructions: Sequence[tuple[str, str]]
    frames: pd.DataFrame
    regressors: pd.DataFrame
    settings: Sequence[tuple[str, str]]


def summary_page(found: SummaryInputs, embed_video_mb: float, folder: Path) -> str:
    """The page in `folder` as one string of HTML with everything embedded."""
    takes = len(found.frames)
    total = int(found.frames["frames"].sum()) if takes else 0

    def images(pairs: Sequence[tuple[str, Path]], caption: str) -> str:
        return "".join(page.image(path, caption.format(name), folder) for name, path in pairs)

    figures = three_figures(found.headline, found.flagged, total, found.applied)
    return page.page(
        "Lips: what was built and how accurate it is",
        f"{takes} takes, {total} frames. Every table is also a TSV file beside this page; an image leads to its file.",
        [
            ("The video beside its result", beside(found.videos, found.timelines, embed_video_mb, folder)),
            ("Three figures", page.figures(figures)),
        ],
        [
            ("What learning brings", _learning(found)),
            ("Key figures", _key_figures(found)),
            ("What the comparisons say", lips16_sections.comparison_section(
                found.comparisons, found.estimators, found.table1, found.configured)),
            ("Table 1: tracking error", _table1(found, folder)),
            ("Tables 2 and 3: influence of the features", lips16_sections.feature_section(found.table2, found.table3)),
            ("RBF network, affine map, kernel regression", lips16_sections.estimator_section(found.estimators)
             + page.image(found.figure16, _FIGURE16_CAPTION, folder)),
            ("Renders", images(found.renders, _RENDER_CAPTION)),
            ("Surface stretch", images(found.stretch, _STRETCH_CAPTION)),
            ("Error maps", images(found.error_maps, _MAP_CAPTION)),
            ("Over time", images(found.over_time, "{}: held-out frames.")),
            ("Kinds of mouth shapes", lips16_sections.kinds_section(found.kinds)),
            ("Further measures", _further(found.measures)),
            ("Accuracy of H", _reconstruction(found)),
            ("Training", images(found.curve_images, "{}: cross-validation error.")),
            ("Flagged frames", _flagged(found)),
            ("Images of every stage", _stages(found.overlays, folder)),
            ("How this was measured", how_measured(found.frames, found.regressors, found.settings)),
        ],
    )  # fmt: skip


_RENDER_CAPTION = (
    "{}: held-out frames with the largest error of the base track, from front and side: the image, "
    "every regressor, the truth (Lips16 figures 10, 12, 13)."
)
_STRETCH_CAPTION = (
    "{}: surface stretch of the same frames, each against its own neutral: red is stretched, blue "
    "compressed (Lips16 figures 9 and 11)."
)
_FIGURE16_CAPTION = (
    "Lips16 figure 16: RBF network and affine map over time, each with its best parameters. Above, mean "
    "vertex error over the mouth mask; below, error of the layers where they are known."
)
_MAP_CAPTION = (
    "{}: distance of each vertex to its corresponding point, held-out frames with the largest error "
    "of the base track; grey is not measured (Lips16 figures 14 and 15)."
)


def _learning(found: SummaryInputs) -> str:
    """What learning brings over a regressor that learnt nothing."""
    if found.headline.empty:
        return ""
    sentences = learning_sentences(found.headline, found.comparisons)
    items = "".join(f"<li>{page.text(sentence)}</li>" for sentence in sentences)
    headings = {
        "regressor": "regressor", "lip_motion_mm": "lip motion, mm", "lip_motion_ratio": "of base",
        "over_null": "of null", "null": "which null", "aperture_mm": "opening, mm", "aperture_ratio": "of base",
        "contour_error_px": "contours", "vertex_error_mm": "vertices over the mouth, mm",
        "ratio_to_base": "of base", "lip_shape_mm": "lip shape, mm", "lve_mm2": "LVE, mm2",
        "flipped_rate": "flipped", "inner_mouth_rate": "inner mouth before lips",
        "edge_roughness_ratio": "edge roughness of base", "frames": "frames",
    }  # fmt: skip
    return (
        f"<ul>{items}</ul><p><i>null</i> has learnt nothing: its layers are zero, on the same path, told the same "
        "neutral, laid on the same image. What does not beat it is not owed to learning.</p>"
        + page.table(found.headline, headings)
    )


def _key_figures(found: SummaryInputs) -> str:
    items = []
    rows = found.headline.set_index("regressor")
    for name in rows.index:
        row = rows.loc[name]
        if name == "base":
            items.append(
                (f"{row['lip_motion_mm']:.2f} mm", "base track, error of the lips' motion")
            )
        else:
            ratio = f"{row['lip_motion_ratio']:.2f}"
            items.append((ratio, f"of base: {name} ({row['lip_motion_mm']:.2f} mm)"))
    h = _value(found.measures, "surface_error_median_mm", "vermilion", "H")
    if h is not None:
        items.append((f"{h:.2f} mm", "H, median surface error over the vermilion"))
    items.append((str(len(found.flagged)), "flagged frames, all stages"))
    return page.figures(items)


def _table1(found: SummaryInputs, folder: Path) -> str:
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
    own = rows[~rows["regressor"].map(is_variant)]
    tables = page.table(own, headings, "where")
    if len(own) < len(rows):
        tables += page.folded("With all variants", page.table(rows, headings, "where"))
    return tables + page.image(found.table1_image, caption, folder)


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
    closed = "" if (rows["measure"] == "false_open_rate").any() else _NEVER_CLOSED
    note = (
        closed + "<p>All takes together; each take by itself is in <code>measures.tsv</code>.</p>"
    )
    return note + page.table(wide, headings, "region")


_NEVER_CLOSED = (
    "<p>No held-out frame has lips that touch in truth, so that there is no false_open_rate.</p>"
)


def _reconstruction(found: SummaryInputs) -> str:
    links = ", ".join(
        f'<a href="{page.text(link)}">{page.text(name)}</a>' for name, link in found.reconstructions
    )
    links = f"<p>How each take was reconstructed, page by page: {links}.</p>" if links else ""
    rows = found.measures[found.measures["regressor"] == "H"]
    if rows.empty:
        return links + '<p class="none">No tattoo take has known truth to hold H against.</p>'
    rows = rows.assign(where=rows["subject"] + "/" + rows["take"])
    headings = {
        "where": "take", "region": "region", "measure": "measure", "value": "value",
        "low": "low", "high": "high", "unit": "unit", "frames": "frames",
    }  # fmt: skip
    return links + (
        "<p>The multi-view reconstruction itself against known truth, in the rig's world, without "
        "any alignment.</p>" + page.table(rows, headings, "where")
    )


def _flagged(found: SummaryInputs) -> str:
    if found.flagged.empty:
        return '<p class="none">None.</p>'
    rows = found.flagged.assign(where=found.flagged["subject"] + "/" + found.flagged["take"])
    counts = page.frames_of_each(rows, ["stage", "where", "reason"])
    headings = {
        "stage": "stage", "where": "take", "count": "frames", "which": "which", "reason": "reason"
    }  # fmt: skip
    return page.table(counts, headings, "stage")


def _stages(overlays: Sequence[Overlay], folder: Path) -> str:
    body = ""
    for stage in sorted({o.stage for o in overlays}, key=_rank):
        of_stage = [o for o in overlays if o.stage == stage]
        images = "".join(page.image(o.path, o.what, folder) for o in of_stage)
        body += page.folded(f"{stage} ({len(of_stage)})", images)
    return body


def _rank(stage: str) -> tuple[int, str]:
    return (_STAGES.index(stage) if stage in _STAGES else len(_STAGES), stage)


def _together(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows of all takes together."""
    return rows[(rows["subject"] == "all") & (rows["take"] == "all")]


def _value(measures: pd.DataFrame, measure: str, region: str, regressor: str) -> float | None:
    rows = _together(measures)
    rows = rows[
        (rows["measure"] == measure) & (rows["region"] == region) & (rows["regressor"] == regressor)
    ]
    return None if rows.empty else float(rows["value"].iloc[0])
