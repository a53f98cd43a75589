"""Pictures of the report: error maps, curves over time, table 1."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import pandas as pd

from vermilion.camera import Camera, look_at, pinhole
from vermilion.draw import colour_map
from vermilion.evaluation.table1 import in_order, kind_of, place_of
from vermilion.export.shading import shade
from vermilion.plot import new_figure, plain, save, with_gaps

COLOURS = {
    "base": "#8c8c8c", "oracle": "#2b2b2b", "contour": "#b08d57", "PS": "#c8553d",
    "MS": "#2a6f97", "GR": "#4f8a3c", "H": "#7b5ea7",
}  # fmt: skip
_INK = "#222222"
_GREY = (0.72, 0.72, 0.72)


def colour_of(regressor: str) -> str:
    """Colour of a regressor's line, the same in all figures."""
    return COLOURS.get(kind_of(regressor).split("/")[0], "#999999")


def line_of(regressor: str) -> str:
    return "--" if "/" in regressor else "-"


def map_frames(error_mm: np.ndarray, count: int) -> np.ndarray:
    """Which frames (F,) mm to draw: the worst one in each of `count` equal stretches."""
    stretches = np.array_split(np.arange(len(error_mm)), min(count, len(error_mm)))
    filled = np.nan_to_num(error_mm)
    return np.array([part[np.argmax(filled[part])] for part in stretches if len(part)])


def error_maps(
    meshes_mm: dict[str, np.ndarray],
    errors_mm: dict[str, np.ndarray],
    triangles: np.ndarray,
    mouth: np.ndarray,
    frames: Sequence[int],
    scale_mm: float,
    size_px: int,
) -> np.ndarray:
    """Meshes coloured by their error, a row a frame and view, a column a regressor.

    Args:
        meshes_mm: regressor -> (n, V, 3) in the head frame (y up, z out of the face).
        errors_mm: regressor -> (n, V); NaN, drawn grey, where not measured.
        triangles: (T, 3) to draw.
        mouth: (V,) bool, what the views are centred on.
        frames: numbers of the n frames, for the labels.
        scale_mm: error of the hottest colour.

    Returns:
        (h, w, 3) uint8, with a colour bar below.
    """
    names = in_order(meshes_mm)
    rows = []
    for index, frame in enumerate(frames):
        centre = np.nanmean(meshes_mm[names[0]][index][mouth], axis=0)
        extent = np.ptp(meshes_mm[names[0]][index][mouth], axis=0)[:2].max()
        for view, direction in (("front", (0.0, 0.0, 1.0)), ("side", (1.0, 0.0, 0.12))):
            camera = view_of(centre, np.array(direction), 1.35 * extent, size_px)
            pictures = []
            for name in names:
                colours = colour_map(errors_mm[name][index], 0.0, scale_mm)
                colours[np.isnan(errors_mm[name][index])] = _GREY
                paper = np.full((camera.height_px, camera.width_px, 3), 255, np.uint8)
                mesh = np.asarray(meshes_mm[name][index], dtype=float)
                picture = shade(paper, camera, mesh, triangles, colours, 1.0)
                text = f"{name}, frame {frame}" if view == "front" else ""
                pictures.append(caption(picture, text))
            rows.append(np.hstack(pictures))
    picture = np.vstack(rows)
    return np.vstack([picture, colour_bar(picture.shape[1], scale_mm)])


def view_of(centre_mm: np.ndarray, direction: np.ndarray, width_mm: float, size_px: int) -> Camera:
    """A long lens that looks at `centre_mm` from `direction`, `width_mm` wide there, nearly square."""
    far = 1500.0
    pose = look_at(centre_mm + far * direction / np.linalg.norm(direction), centre_mm, (0, 1, 0))
    return pinhole("view", far * size_px / width_mm, size_px, size_px, pose)


def caption(picture: np.ndarray, text: str) -> np.ndarray:
    """Dark text on the white paper of (h, w, 3) uint8."""
    if text:
        picture = np.ascontiguousarray(picture)
        cv2.putText(
            picture, text, (8, 18), cv2.FONT_HERSHEY_SIMPLEX, 0.45, (30, 30, 30), 1, cv2.LINE_AA
        )
    return picture


def colour_bar(width_px: int, scale_mm: float) -> np.ndarray:
    """(46, width, 3) uint8: the colours of 0 to `scale_mm`."""
    bar = np.full((46, width_px, 3), 255, dtype=np.uint8)
    left, length = 12, min(360, width_px - 90)
    ramp = colour_map(np.linspace(0, 1, length), 0, 1)
    bar[8:22, left : left + length] = np.rint(255 * ramp)
    for share in (0.0, 0.5, 1.0):
        text = f"{share * scale_mm:g}" + (" mm and over" if share == 1 else "")
        place = (left + round(share * length) - (0 if share == 0 else 8), 38)
        cv2.putText(bar, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.42, (30, 30, 30), 1, cv2.LINE_AA)
    return bar


def curves(table: pd.DataFrame, title: str, out: str | Path) -> None:
    """Errors over time as PNG: mouth, vermilion, and the gap between the lips.

    Args:
        table: columns frame, regressor, vermilion_mm, mouth_mm, aperture_mm; the rows of regressor
            `truth` have the true aperture alone.
    """
    figure = new_figure(8.6, 6.6)
    axes = figure.subplots(3, 1, sharex=True)
    panels = (
        ("mouth_mm", "mouth, mm"),
        ("vermilion_mm", "vermilion, mm"),
        ("aperture_mm", "gap, mm"),
    )
    for axis, (column, text) in zip(axes, panels, strict=True):
        for regressor in in_order(r for r in table["regressor"] if r != "truth"):
            rows = table[table["regressor"] == regressor]
            axis.plot(
                *with_gaps(rows["frame"].to_numpy(), rows[column].to_numpy(dtype=float)),
                line_of(regressor), color=colour_of(regressor), lw=1.4, label=regressor,
            )  # fmt: skip
        if column == "aperture_mm":
            rows = table[table["regressor"] == "truth"]
            axis.plot(
                *with_gaps(rows["frame"].to_numpy(), rows[column].to_numpy(dtype=float)),
                ":", color=_INK, lw=1.4, label="truth",
            )  # fmt: skip
        axis.set_ylabel(text)
        plain(axis)
        axis.set_ylim(bottom=0)
    axes[0].set_title(title, loc="left", fontsize=10)
    axes[-1].set_xlabel("frame")
    handles, labels = axes[-1].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=8, frameon=False, fontsize=8)
    save(figure, out)


def bars(table: pd.DataFrame, out: str | Path) -> None:
    """Table 1 as a picture: mean error of each regressor with its interval, a group a take."""
    groups = list(table.groupby(["subject", "take"], sort=False))
    figure = new_figure(8.6, 0.9 + 0.26 * (len(table) + 1.5 * len(groups)))
    axis = figure.subplots()
    places, names, y = [], [], 0.0
    for (subject, take), rows in groups:
        axis.text(
            0, y, place_of(subject, take), fontsize=8.5, fontweight="bold", va="center", color=_INK
        )
        y += 1
        for row in rows.itertuples():
            axis.barh(y, row.mean_mm, 0.72, color=colour_of(row.regressor))
            if np.isfinite(row.low_mm):
                axis.plot([row.low_mm, row.high_mm], [y, y], color=_INK, lw=1.1)
            ratio = "" if row.regressor == "base" else f"  ({row.ratio_to_base:.2f} of base)"
            text = f"{row.mean_mm:.2f} ± {row.std_mm:.2f} mm{ratio}"
            edge = max(row.mean_mm, row.high_mm if np.isfinite(row.high_mm) else 0.0)
            axis.text(edge, y, "  " + text, fontsize=7.5, va="center", color=_INK)
            places.append(y)
            names.append(row.regressor)
            y += 1
        y += 0.5
    axis.set_yticks(places, names, fontsize=8)
    axis.invert_yaxis()
    axis.set_xlim(0, 1.5 * np.nanmax([1e-3, *table["mean_mm"], *table["high_mm"]]))
    axis.set_xlabel("mean vertex error over the mouth mask, mm (line: interval over clips)")
    plain(axis)
    axis.grid(False)
    save(figure, out)
