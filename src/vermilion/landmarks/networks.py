"""The face and 66-landmark networks of OpenSeeFace (BSD-2), run by onnxruntime.

The files are the user's; they are not part of Vermilion. Both networks take RGB at 224 x 224.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vermilion.landmarks.detector import MAX_FACES, Landmarks, apart, most_prominent
from vermilion.landmarks.network_input import SIZE, network_input
from vermilion.landmarks.sets import IBUG66
from vermilion.storage.errors import InputError

FACE_FILE = "mnv3_detection_opt.onnx"
LANDMARK_FILE = "lm_model0_opt.onnx"

# Where the landmarks lie in the face network's boxes, in heights of the box, over faces of rendered and
# real takes: their centre below the box's, their extent. So the first crop is nearly right.
_DOWN, _WIDE, _HIGH = 0.23, 1.15, 1.2


@dataclass(frozen=True)
class NetworkSettings:
    """How the networks' answers are judged.

    Attributes:
        face_threshold: least score of a face, [0, 1].
        landmark_threshold: least mean confidence of the landmarks, [0, 1].
        passes: crops per face, each but the first round the landmarks of the one before.
    """

    face_threshold: float = 0.5
    landmark_threshold: float = 0.6
    passes: int = 2


class NetworkDetector:
    """Detects face and landmarks in each image by itself, so that chunks do not matter."""

    landmark_set = IBUG66

    def __init__(self, folder: str | Path, settings: NetworkSettings | None = None):
        self.settings = settings or NetworkSettings()
        self._face = _session(Path(folder) / FACE_FILE)
        self._landmarks = _session(Path(folder) / LANDMARK_FILE)

    def detect(self, linear_rgb: np.ndarray) -> Landmarks:
        """Landmarks of the face in `linear_rgb` (h, w, 3) with the highest score times size."""
        return most_prominent(self.faces(linear_rgb), self.landmark_set)

    def faces(self, linear_rgb: np.ndarray) -> list[Landmarks]:
        """Faces in `linear_rgb` (h, w, 3), those with the highest score times size first."""
        found = [self._points_in(linear_rgb, box) for box in self._boxes(linear_rgb)[:MAX_FACES]]
        threshold = self.settings.landmark_threshold
        sure = [f for f in found if f.found and f.confidence.mean() >= threshold]
        return apart(sure, MAX_FACES)

    def _boxes(self, image: np.ndarray) -> list[np.ndarray]:
        """Boxes (x, y, width, height) px expected round the landmarks of the faces.

        The most prominent face is first.
        """
        height, width = image.shape[:2]
        scores, peaks = _run(self._face, image)
        score, radius = scores[0], scores[1] * 112.0
        rows, columns = np.nonzero((score == peaks[0]) & (score >= self.settings.face_threshold))
        boxes = []
        for row, column in zip(rows, columns, strict=True):
            r = radius[row, column]
            x, y = column * 4.0 * width / SIZE, row * 4.0 * height / SIZE
            tall = 2 * r * height / SIZE
            wide, high = _WIDE * tall, _HIGH * tall
            box = np.array([x - wide / 2, y + _DOWN * tall - high / 2, wide, high])
            boxes.append((score[row, column] * r, box))
        return [box for _, box in sorted(boxes, key=lambda item: -item[0])]

    def _points_in(self, image: np.ndarray, box: np.ndarray) -> Landmarks:
        found = Landmarks.none()
        for _ in range(self.settings.passes):
            crop = _padded(box, image.shape)
            if crop is None:
                break
            x0, y0, x1, y1 = crop
            field = _run(self._landmarks, image[y0:y1, x0:x1])[0]
            points, confidence = decode_heat_maps(field)
            points = (points + 0.5) * np.array([x1 - x0, y1 - y0]) / SIZE + [x0, y0]
            found = Landmarks(points, confidence, True)
            low, high = points.min(axis=0), points.max(axis=0)
            box = np.concatenate([low, high - low])
        return found


def decode_heat_maps(field: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points (66, 2) in the network's 224 x 224 pixels (centres whole) and confidences (66,).

    Args:
        field: (198, 28, 28): confidence, y offset, x offset of each point.
    """
    maps = field.reshape(3, IBUG66.n_points, 28 * 28)
    cell = maps[0].argmax(axis=1)
    point = np.arange(IBUG66.n_points)
    confidence = maps[0][point, cell].astype(np.float64)
    y = 223.0 * ((cell // 28) / 27.0 + _logit(maps[1][point, cell]))
    x = 223.0 * ((cell % 28) / 27.0 + _logit(maps[2][point, cell]))
    return np.stack([x, y], axis=1), np.clip(confidence, 0.0, 1.0)


def _logit(p: np.ndarray) -> np.ndarray:
    p = np.clip(p.astype(np.float64), 1e-7, 1 - 1e-7)
    return np.log(p / (1 - p)) / 16.0


def _padded(box: np.ndarray, shape: tuple[int, ...]) -> tuple[int, int, int, int] | None:
    """Crop of a box with 10 % of its width and 12.5 % of its height on each side; None if empty."""
    x, y, width, height = box
    x0, x1 = int(x - 0.1 * width), int(x + 1.1 * width)
    y0, y1 = int(y - 0.125 * height), int(y + 1.125 * height)
    x0, y0 = max(x0, 0), max(y0, 0)
    x1, y1 = min(x1, shape[1]), min(y1, shape[0])
    if x1 - x0 < 8 or y1 - y0 < 8:
        return None
    return x0, y0, x1, y1


def _run(session, linear_rgb: np.ndarray) -> list[np.ndarray]:
    outputs = session.run(None, {session.get_inputs()[0].name: network_input(linear_rgb)[None]})
    return [output[0] for output in outputs]


def _session(path: Path):
    import onnxruntime

    if not path.is_file():
        raise InputError(
            "no such file",
            f"the networks {FACE_FILE} and {LANDMARK_FILE} of OpenSeeFace",
            "Set landmarks.detector.path to the folder that holds them.",
            path=path,
        )
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 3
    try:
        return onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    except Exception as error:  # onnxruntime raises several kinds
        raise InputError(
            f"a network that cannot be loaded ({error})",
            "an ONNX file",
            "Copy the file again.",
            path=path,
        ) from error
