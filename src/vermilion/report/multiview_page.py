"""The report page of a take: figures, curves, flagged frames, sheets of chosen frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import pandas as pd

from vermilion.imaging.plot import png
from vermilion.multiview.drift import ALL
from vermilion.report import page
from vermilion.report.multiview_curves import curves_figure

#: Columns that choose frames, with the words for why.
WORST = {
    "residual_px": "largest residual",
    "drift_mm_vermilion": "largest drift of the vermilion",
    "contact_vertices": "most contact",
}


@dataclass(frozen=True)
class TakeFindings:
    """What is known of a take.

    Attributes:
        name: `subject/take`.
        neutral: frame number of the neutral.
        cameras: names of the rig's cameras.
        frames: a row a frame: the quality table's columns, those of the drift's rows of all
            cameras, similarity, anchor (bool); without rows for a take of a neutral alone.
        drift: rows a frame and camera, see `drift.drift_rows`.
        across: the same rows of the neutral, each camera against its neighbour.
    """

    name: str
    neutral: int
    cameras: Sequence[str]
    frames: pd.DataFrame
    drift: pd.DataFrame
    across: pd.DataFrame


@dataclass(frozen=True)
class FrameSheet:
    """A frame's images (h, w, 3) uint8 and why it is shown."""

    frame: int
    why: str
    image: np.ndarray


def join_frames(
    quality: pd.DataFrame, drift: pd.DataFrame, similarity: np.ndarray, anchors: np.ndarray
) -> pd.DataFrame:
    """One row a frame, for `TakeFindings.frames`; similarity, anchors (F,) in the order of `quality`."""
    together = drift[drift["camera"] == ALL].drop(columns=["subject", "take", "camera", "reason"])
    together = together.rename(columns={"measured_percent": "measured_percent_drift"})
    table = quality.merge(together, on="frame", how="left", validate="one_to_one")
    table = table.assign(similarity=similarity, anchor=np.asarray(anchors, dtype=bool))
    for name in WORST:
        if name not in table:  # no frame could be registered
            table[name] = np.nan
    return table.assign(reason=table["reason"].fillna(""))


def choose_frames(frames: pd.DataFrame, neutral: int, spaced: int, flagged: int) -> dict[int, str]:
    """Frames to draw, in order, and why: the neutral, the worst ones, flagged ones, spaced ones.

    Frames that could not be read have nothing to draw and are left out.
    """
    why: dict[int, list[str]] = {neutral: ["neutral"]}

    def add(number: int, reason: str) -> None:
        why.setdefault(int(number), []).append(reason)

    if len(frames):
        readable = frames[frames["measured_percent_drift"].notna()]
        for column, text in WORST.items():
            values = readable[column].fillna(0)
            if len(values) and values.max() > 0:
                add(readable["frame"][values.idxmax()], text)
        bad = readable[readable["valid"] == 0].sort_values(
            ["drift_mm_vermilion", "frame"], ascending=[False, True]
        )
        for number in bad["frame"][:flagged]:
            add(number, "flagged")
        rows = np.linspace(0, len(readable) - 1, spaced + 2).round().astype(int)[1:-1]
        for number in readable["frame"].to_numpy()[rows] if len(readable) else []:
            if int(number) not in why:
                add(number, "at even distances")
    return {number: ", ".join(why[number]) for number in sorted(why)}


def report_page(found: TakeFindings, sheets: Sequence[FrameSheet], page_mb: float) -> str:
    """The page as one string of HTML with everything embedded."""
    lead = "Multi-view reconstruction: how well each frame is known, and where to look."
    body = ""
    if len(found.frames):
        body = page.embedded(png(curves_figure(found.frames, found.neutral)), "png", _CURVES)
    return page.page(
        f"{found.name}: reconstruction",
        lead,
        [
            ("At a glance", page.figures(_key_figures(found))),
            ("Flagged frames", _flagged(found.frames)),
            ("Missing images", _missing(found)),
            ("Over time", body),
            ("Cameras", _cameras(found)),
            ("Frames in every camera", _sheets(sheets, page_mb, len(body))),
            ("How to read this", _HOW),
        ],
    )


def _key_figures(found: TakeFindings) -> list[tuple[str, str]]:
    frames, missing = found.frames, _missing_rows(found)
    items = [(str(max(len(frames), 1)), "frames"), (str(len(found.cameras)), "cameras")]
    items.append((str(len(missing)), "missing images"))
    if not len(frames):
        row = found.across[found.across["camera"] == ALL].iloc[0]
        text = "median disagreement of neighbouring cameras on the skin of the neutral"
        return [*items, (_figure(row["drift_mm_skin"], "mm"), text)]
    bad = frames[frames["valid"] == 0]
    anchors = page.spans(frames["frame"][frames["anchor"]].tolist())
    items += [
        (str(int(frames["anchor"].sum())), f"anchors: {anchors}"),
        (str(len(bad)), "flagged frames"),
        (_figure(frames["residual_px"].median(), "px"), "median residual"),
        (
            _figure(_without_neutral(found, "drift_mm_vermilion").median(), "mm"),
            "median drift, vermilion",
        ),
        (
            _figure(_without_neutral(found, "drift_mm_vermilion").max(), "mm"),
            "drift of the worst frame",
        ),
    ]
    return items


def _without_neutral(found: TakeFindings, column: str) -> pd.Series:
    """A column without the neutral, which has no drift against itself."""
    return found.frames[column][found.frames["frame"] != found.neutral]


def _figure(value: float, unit: str) -> str:
    return f"{page.number(float(value))} {unit}" if np.isfinite(value) else "unknown"


def _flagged(frames: pd.DataFrame) -> str:
    bad = frames[frames["valid"] == 0] if len(frames) else frames
    if bad.empty:
        return '<p class="none">None.</p>'
    rows = page.frames_of_each(bad, ["reason"])
    note = "<p>The positions of these frames are not to be trusted.</p>"
    return note + page.table(rows, {"which": "frames", "count": "count", "reason": "reason"})


def _missing(found: TakeFindings) -> str:
    rows = _missing_rows(found)
    if rows.empty:
        return '<p class="none">None: every camera has every frame that could be read.</p>'
    names = {"camera": "camera", "which": "frames", "count": "count", "reason": "reason"}
    first = rows.groupby("camera", sort=True)["reason"].first()
    table = page.frames_of_each(rows, ["camera"])
    return page.table(table.assign(reason=table["camera"].map(first)), names)


def _missing_rows(found: TakeFindings) -> pd.DataFrame:
    rows = found.drift if len(found.frames) else found.across
    reasons = rows["reason"].fillna("")
    return rows[(rows["camera"] != ALL) & (reasons != "")]


_CAMERA_COLUMNS = {
    "camera": "camera", "measured_percent": "measured, %",
    "difference_skin": "difference, skin", "difference_vermilion": "vermilion",
    "drift_px_skin": "px, skin", "drift_px_vermilion": "vermilion",
    "drift_mm_skin": "mm, skin", "drift_mm_vermilion": "vermilion",
}  # fmt: skip


def _cameras(found: TakeFindings) -> str:
    body = ""
    if len(found.frames) > 1:
        rest = found.drift[found.drift["frame"] != found.neutral]
        body = (
            "<p>Drift of each camera, median over the frames. A camera that stands out is out of "
            "calibration, out of focus or out of step.</p>" + _camera_table(rest)
        )
    body += (
        "<p>The neutral: each camera's image carried to its neighbour through the mesh. What is "
        "left here is an error of the surface, of the calibration, or shading.</p>"
    )
    return body + _camera_table(found.across)


def _camera_table(rows: pd.DataFrame) -> str:
    columns = [column for column in _CAMERA_COLUMNS if column != "camera"]
    return page.table(rows.groupby("camera")[columns].median().reset_index(), _CAMERA_COLUMNS)


def _sheets(sheets: Sequence[FrameSheet], page_mb: float, used: int) -> str:
    """The sheets as JPEG, made smaller together until the page keeps to its size."""
    room = max(page_mb * 1e6 - used, 1e5) * 3 / 4  # of which base64 makes the page
    scale, files = 1.0, [page.jpeg(sheet.image, 82) for sheet in sheets]
    while sum(map(len, files)) > room and scale > 0.1:
        scale *= min(0.9, np.sqrt(room / sum(map(len, files))))
        files = [page.jpeg(_shrunk(sheet.image, scale), 78) for sheet in sheets]
    return "".join(
        f"<h3>Frame {sheet.frame}</h3>" + page.embedded(file, "jpeg", f"{sheet.why}.")
        for sheet, file in zip(sheets, files, strict=True)
    )


def _shrunk(image: np.ndarray, scale: float) -> np.ndarray:
    size = tuple(max(1, round(n * scale)) for n in (image.shape[1], image.shape[0]))
    return cv2.resize(image, size, interpolation=cv2.INTER_AREA)


_CURVES = "Red lines: flagged frames. Dashed lines: anchors. Dotted line: the neutral."

_HOW = """
<p><b>Mesh.</b> The grid lies on the neutral and is carried by the mesh: a line of it keeps to the same
spot of the skin or of the tattoo from frame to frame. Orange: borders of the vermilion and of the mouth.</p>
<p><b>Points.</b> The frame's own stereo points that the camera sees; red lies outside the mesh, blue
inside.</p>
<p><b>Residual.</b> How far this camera's image would move the mesh: the flow from the neutral's image,
carried by the mesh, to the real one. Grey: not measured by this camera.</p>
<p><b>Cameras that measured.</b> From blue (one) to yellow (all). Grey: no camera; the shape prior alone
placed the surface there.</p>
<p><b>Drift.</b> The neutral's image carried through the mesh, less the real one, both with their local
contrast brought to one. Difference: mean absolute, in local deviations; 0 is the same texture, about 1.1
unrelated texture; fine noise alone gives some tenths. Drift in px and mm: length of the flow that is left,
median over the vertices and cameras that measured it, in pixels of the original images and across the
line of sight. Plain skin has little texture, so its flow is noisier than that of the tattoo. A drift that
grows with the distance from the neutral is a slip; one that stays is noise, exposure or calibration.
Every frame and camera is in <code>drift.tsv</code>.</p>
<p><b>The neutral's sheet</b> carries the image of the neighbouring camera instead: it shows the error of
the surface.</p>
"""
