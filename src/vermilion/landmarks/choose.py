"""The detector that a configuration names, ready to use."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from vermilion.landmarks.descent import DescentDetector
from vermilion.landmarks.detector import LandmarkDetector
from vermilion.landmarks.mediapipe import MediapipeDetector, environment_python
from vermilion.landmarks.networks import NetworkDetector, NetworkSettings
from vermilion.storage.errors import InputError


def open_detector(kind: str, model: str, networks: dict[str, Any]) -> LandmarkDetector:
    """The detector of a kind.

    Args:
        kind: `mediapipe`: the attention mesh, in the environment `model`; `onnx`: the networks in the
            folder `model`; `trained`: the regressor in the file `model`.
        networks: settings of `onnx`.
    """
    if kind == "mediapipe":
        return MediapipeDetector(model)
    if kind == "onnx":
        return NetworkDetector(model, NetworkSettings(**networks))
    if kind == "trained":
        return DescentDetector.load(model)
    raise ValueError(f"no detector '{kind}' that works on images")


def usable_kind(kind: str, environment: str, models: str, training: bool) -> tuple[str, str]:
    """The kind of detector that can run here, and a sentence where it is not the wanted one.

    Args:
        kind: the wanted kind.
        environment: folder of the environment of `mediapipe`.
        models: folder of the networks of `onnx`; empty where there is none.
        training: whether there are takes to train `trained` on.

    Raises:
        InputError: `mediapipe` is wanted, cannot run, and nothing can take its place.
    """
    if kind != "mediapipe":
        return kind, ""
    try:
        environment_python(environment)
    except InputError as error:
        if models and Path(models).is_dir():
            return "onnx", f"Landmarks come from the networks in {models} (onnx) instead: {error}"
        if training:
            return (
                "trained",
                f"Landmarks come from the embedded regressor (trained) instead: {error}",
            )
        raise
    return kind, ""
