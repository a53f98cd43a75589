"""Inpainting against known images without tattoo, and against OpenCV's Telea, on a small mouth.

PSNR (dB) of display colours over the pixels that the tattoo changed, on the mouth of
tests/lip_patch.py, with exact meshes and with meshes that are wrong by 0.5 mm; core seconds a frame.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from functools import partial

import cv2
import numpy as np

from benchmarks.common import print_table, timed
from tests import lip_patch
from vermilion.faces.model import FaceModel
from vermilion.geometry.raycast import RayCaster
from vermilion.imaging.draw import to_display
from vermilion.inpaint.bake import bake
from vermilion.inpaint.domain import lip_domain
from vermilion.inpaint.frame import InpaintInputs, inpaint_frame
from vermilion.inpaint.shading import ShadingSettings
from vermilion.inpaint.tattoo import feather_mask, tattoo_mask

VARIANTS = ("ratio", "difference", "none")


def squared_error(a: np.ndarray, b: np.ndarray, where: np.ndarray) -> np.ndarray:
    """Squared difference (N, 3) of display images `a` and `b` (h, w, 3) over the pixels `where` (h, w)."""
    return ((a[where].astype(float) - b[where]) / 255) ** 2


def decibels(mean_square: float) -> float:
    """PSNR of a mean squared error of colours from 0 to 1."""
    return float(-10 * np.log10(max(mean_square, 1e-12)))


def wrong_by(vertices: np.ndarray, rms_mm: float, seed: int) -> np.ndarray:
    """The `vertices` (V, 3) mm with a smooth error added."""
    rng = np.random.default_rng(seed)
    waves = sum(
        np.sin(vertices @ rng.normal(0, 0.15, (3, 3)) + rng.uniform(0, 6, 3)) for _ in range(4)
    )
    return vertices + waves * rms_mm / np.sqrt((waves**2).sum(axis=1).mean())


def paints(model: FaceModel, rig: dict, error_mm: float) -> dict[str, InpaintInputs]:
    """The inpainter of each shading, its textures baked on meshes that are wrong by `error_mm`."""
    domain = lip_domain(model, 9.0, 4.0, 0.3)

    def baked(tattoo, names, seed):
        views = [
            (rig[name], lip_patch.render(model, model.neutral_mm, rig[name], tattoo))
            for name in names
        ]
        mesh = wrong_by(model.neutral_mm, error_mm, seed)
        return bake(domain, RayCaster(mesh, model.triangles), mesh, views)

    plain, tattooed, reference = baked(0, rig, 1), baked(1, rig, 2), baked(1, ["front"], 2)
    opacity = feather_mask(domain, tattoo_mask(domain, tattooed, plain, 4.0, 6.0), 0.6, 1.0)
    return {
        mode: InpaintInputs(
            domain, plain, reference, opacity, ShadingSettings(mode), 0.8, 0.0, grain=False
        )
        for mode in VARIANTS
    }


def rows_of(model: FaceModel, rig: dict, error_mm: float) -> Iterator[dict]:
    """A row a pose and shading."""
    painters, camera = paints(model, rig, error_mm), rig["front"]
    for pose, values in lip_patch.POSES.items():
        truth_mm = lip_patch.vertices_at(*values)
        inked = lip_patch.render(model, truth_mm, camera, True)
        shown = to_display(inked)
        truth = to_display(lip_patch.render(model, truth_mm, camera, False))
        changed = np.abs(shown.astype(int) - truth).max(axis=2) > 20
        mask = cv2.dilate(changed.astype(np.uint8), np.ones((3, 3)))
        telea = cv2.inpaint(shown, mask, 4, cv2.INPAINT_TELEA)
        mesh = wrong_by(truth_mm, error_mm, 2)
        for mode, paint in painters.items():
            ours = timed(partial(inpaint_frame, paint, inked, camera, mesh, model.triangles, (0,)))
            results = {"ours dB": to_display(ours.result.linear), "Telea dB": telea}
            yield (
                {"mesh error mm": error_mm, "pose": pose, "shading": mode}
                | {
                    name: decibels(squared_error(found, truth, mask > 0).mean())
                    for name, found in results.items()
                }
                | {"core s a frame": ours.cpu_s}
            )


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Nothing to choose."""


def run(arguments: argparse.Namespace) -> None:
    """Measure and print."""
    model, rig = lip_patch.face_model(), lip_patch.cameras()
    rows = [row for error_mm in (0.0, 0.5) for row in rows_of(model, rig, error_mm)]
    print_table(rows, {"mesh error mm": 1, "ours dB": 1, "Telea dB": 1})
