"""Accuracy and speed of the corrective flow on a known warp, against OpenCV's DIS flow.

    python -m benchmarks.bench_detail

Six images of 480 x 360 of random skin, moving evenly, the true ones off by a smooth known flow. Prints
the mean error in pixels, CPU seconds, and their ratios to DIS, which sees only two of the images.
"""

from __future__ import annotations

import time

import cv2
import numpy as np

from tests.unit import test_detail_flow as scenes
from vermilion.detail.flow.six_frame_flow import FlowSettings, corrective_flow


def main() -> None:
    scenes.HEIGHT, scenes.WIDTH = 480, 360
    scenes.skin.__defaults__ = ((540, 420),)
    truth = scenes.known_flow()
    frames = scenes.scene(np.array([1.2, 0.5], dtype=np.float32), truth)
    grey = [
        cv2.cvtColor(np.clip(p, 0, 255).astype(np.uint8), cv2.COLOR_RGB2GRAY)
        for p in frames.images[:2]
    ]
    methods = {
        "six frames": lambda: corrective_flow(frames, FlowSettings()),
        "DIS": lambda: cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM).calc(
            *grey, None
        ),
    }
    figures = {}
    for name, method in methods.items():
        method()  # compiles
        start = time.process_time()
        found = method()
        seconds = time.process_time() - start
        error = np.linalg.norm(found - truth, axis=2)[20:-20, 20:-20].mean()
        figures[name] = error, seconds
        print(f"{name}: {error:.3f} px, {seconds:.3f} s")
    (error, seconds), (peer_error, peer_seconds) = figures.values()
    print(f"ratio: error {error / peer_error:.2f}, seconds {seconds / peer_seconds:.0f}")


if __name__ == "__main__":
    main()
