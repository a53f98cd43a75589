"""The detector that a configuration names, ready to use."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from vermilion.landmarks.descent import DescentDetector
from vermilion.landmarks.detector import LandmarkDetector, Landmarks
from vermilion.landmarks.mediapipe import MediapipeDetector, environment_python
from vermilion.landmarks.networks import NetworkDetector, NetworkSettings
from vermilion.landmarks.sets import LandmarkSet
from vermilion.landmarks.table import GivenLandmarks
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


#: Faces in a frame of a number, given its image (h, w, 3) linear RGB, or None where it could not be read.
FindFaces = Callable[[int, np.ndarray | None], list[Landmarks]]


def face_finder(
    kind: str, model: str, networks: dict[str, Any], files: dict[str, Any], file: str
) -> tuple[FindFaces, LandmarkSet]:
    """What finds the faces of a take's frames, and the set of their landmarks.

    Args:
        kind: `files`: those that another tracker wrote to `file`; else as of `open_detector`.
        model, networks: as of `open_detector`.
        files: settings of `files`.
    """
    if kind == "files":
        table = GivenLandmarks(**{**files, "path": file}).read()

        def given(frame: int, image: np.ndarray | None) -> list[Landmarks]:
            found = table.at(frame)
            return [found] if found.found else []

        return given, table.landmark_set
    detector = open_detector(kind, model, networks)

    def detected(frame: int, image: np.ndarray | None) -> list[Landmarks]:
        return [] if image is None else detector.faces(image)

    return detected, detector.landmark_set


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
