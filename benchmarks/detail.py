"""Accuracy and speed of the corrective flow on a known warp, against OpenCV's DIS flow.

Six images of 480 x 360 of random skin, moving evenly, the true ones off by a smooth known flow. Prints
the mean error in pixels, CPU seconds, and their ratios to DIS, which sees only two of the images.
"""

from __future__ import annotations

import argparse

import cv2
import numpy as np

from benchmarks.common import print_table, timed
from tests.unit import test_detail_flow as scenes
from vermilion.detail.flow.six_frame_flow import FlowSettings, corrective_flow


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Nothing to choose."""


def run(arguments: argparse.Namespace) -> None:
    """Measure and print."""
    scenes.HEIGHT, scenes.WIDTH = 480, 360
    scenes.skin.__defaults__ = ((540, 420),)
    truth = scenes.known_flow()
    frames = scenes.scene(np.array([1.2, 0.5], dtype=np.float32), truth)
    grey = [
        cv2.cvtColor(np.clip(p, 0, 255).astype(np.uint8), cv2.COLOR_RGB2GRAY)
        for p in frames.images[:2]
    ]
    peer = cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    methods = {
        "six frames": lambda: corrective_flow(frames, FlowSettings()),
        "DIS": lambda: peer.calc(*grey, None),
    }
    rows = []
    for name, method in methods.items():
        flow = timed(method, warm_up=True)
        error = np.linalg.norm(flow.result - truth, axis=2)[20:-20, 20:-20].mean()
        rows.append({"method": name, "error px": float(error), "cpu s": flow.cpu_s})
    for row in rows:
        row["error ratio"] = row["error px"] / rows[-1]["error px"]
        row["cpu ratio"] = row["cpu s"] / rows[-1]["cpu s"]
    print_table(rows, {"error px": 3, "cpu s": 3, "cpu ratio": 0})
