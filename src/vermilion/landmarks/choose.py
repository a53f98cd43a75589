"""The detector that a configuration names, ready to use."""

from __future__ import annotations

from typing import Any

from vermilion.landmarks.descent import DescentDetector
from vermilion.landmarks.detector import LandmarkDetector
from vermilion.landmarks.networks import NetworkDetector, NetworkSettings


def open_detector(kind: str, model: str, networks: dict[str, Any]) -> LandmarkDetector:
    """`trained`: the regressor in the file `model`; `onnx`: the networks in the folder `model`."""
    if kind == "onnx":
        return NetworkDetector(model, NetworkSettings(**networks))
    if kind == "trained":
        return DescentDetector.load(model)
    raise ValueError(f"no detector '{kind}' that works on images")
