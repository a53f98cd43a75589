"""Inpainting against known un-tattooed images, and against OpenCV's Telea: `python -m benchmarks.bench_inpaint`.

PSNR (dB) of display colours over the pixels that the tattoo changed, on the small mouth of
tests/lip_patch.py, with exact meshes and with meshes that are wrong by 0.5 mm.
"""

from __future__ import annotations

import time

import cv2
import numpy as np

from tests import lip_patch
from vermilion.geometry.raycast import RayCaster
from vermilion.imaging.draw import to_display
from vermilion.inpaint.bake import bake
from vermilion.inpaint.domain import lip_domain
from vermilion.inpaint.frame import InpaintInputs, inpaint_frame
from vermilion.inpaint.shading import ShadingSettings
from vermilion.inpaint.tattoo import feather_mask, tattoo_mask

POSES = {"rest": (0.0, 0.0), "open": (7.0, 0.1), "pucker": (1.0, 1.0)}


def psnr_db(a: np.ndarray, b: np.ndarray, where: np.ndarray) -> float:
    error = (a[where].astype(float) - b[where].astype(float)) / 255
    return float(-10 * np.log10((error**2).mean()))


def wrong_by(vertices: np.ndarray, rms_mm: float, seed: int) -> np.ndarray:
    """A smooth error of the mesh."""
    rng = np.random.default_rng(seed)
    waves = sum(
        np.sin(vertices @ rng.normal(0, 0.15, (3, 3)) + rng.uniform(0, 6, 3)) for _ in range(4)
    )
    return vertices + waves * rms_mm / np.sqrt((waves**2).sum(axis=1).mean())


def main() -> None:
    model, rig = lip_patch.face_model(), lip_patch.cameras()
    domain = lip_domain(model, 9.0, 4.0, 0.3)
    print("mesh error mm\tpose\tshading\tours dB\ttelea dB\ts a frame")
    for error_mm in (0.0, 0.5):

        def baked(tattoo, names, seed, error_mm=error_mm):
            views = [
                (rig[n], lip_patch.render(model, model.neutral_mm, rig[n], tattoo)) for n in names
            ]
            mesh = wrong_by(model.neutral_mm, error_mm, seed)
            return bake(domain, RayCaster(mesh, model.triangles), mesh, views)

        plain, tattooed, reference = baked(0, rig, 1), baked(1, rig, 2), baked(1, ["front"], 2)
        opacity = feather_mask(domain, tattoo_mask(domain, tattooed, plain, 4.0, 6.0), 0.6, 1.0)
        for pose, values in POSES.items():
            truth_mm, camera = lip_patch.vertices_at(*values), rig["front"]
            inked = lip_patch.render(model, truth_mm, camera, True)
            truth = to_display(lip_patch.render(model, truth_mm, camera, False))
            where = np.abs(to_display(inked).astype(int) - truth).max(axis=2) > 20
            where = cv2.dilate(where.astype(np.uint8), np.ones((3, 3)))
            telea = psnr_db(
                cv2.inpaint(to_display(inked), where, 4, cv2.INPAINT_TELEA), truth, where > 0
            )
            for mode in ("ratio", "difference", "none"):
                paint = InpaintInputs(
                    domain, plain, reference, opacity, ShadingSettings(mode), 0.8, 0.0, grain=False
                )
                mesh, start = wrong_by(truth_mm, error_mm, 2), time.perf_counter()
                ours = inpaint_frame(paint, inked, camera, mesh, model.triangles, (0,))
                seconds = time.perf_counter() - start
                value = psnr_db(to_display(ours.linear), truth, where > 0)
                print(f"{error_mm}\t{pose}\t{mode}\t{value:.1f}\t{telea:.1f}\t{seconds:.2f}")


if __name__ == "__main__":
    main()
