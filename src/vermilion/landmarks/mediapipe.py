"""mediapipe's attention mesh: 478 landmarks, run in an environment of its own.

mediapipe 0.10.21 (Apache-2.0) is the last version whose wheel contains its networks, and it needs an older
numpy than Vermilion's. So `mediapipe_runner.py` runs as one process beside, in the environment that
`tools/setup_landmarks.sh` makes, and is handed images one by one.
"""

from __future__ import annotations

import os
import struct
import subprocess
import tempfile
from pathlib import Path
from typing import IO

import numpy as np

from vermilion.imaging.display import srgb8
from vermilion.landmarks import mediapipe_runner
from vermilion.landmarks.detector import MAX_FACES, Landmarks, most_prominent
from vermilion.landmarks.sets import MEDIAPIPE478, LandmarkSet
from vermilion.storage.errors import InputError


class MediapipeDetector:
    """Landmarks of each image by itself, so that chunks do not matter.

    A face is found with its mirror image, and the two answers are averaged: what the network has learnt
    of one side only goes, and so does a part of its noise.
    """

    landmark_set: LandmarkSet = MEDIAPIPE478

    def __init__(self, environment: str | Path):
        """`environment`: folder of the virtual environment. Raises InputError where it is absent."""
        self._python = environment_python(environment)
        self._process: subprocess.Popen[bytes] | None = None

    def detect(self, linear_rgb: np.ndarray) -> Landmarks:
        """Landmarks of the largest face in `linear_rgb` (h, w, 3) float32."""
        return most_prominent(self.faces(linear_rgb), self.landmark_set)

    def faces(self, linear_rgb: np.ndarray) -> list[Landmarks]:
        """Up to `MAX_FACES` faces in `linear_rgb` (h, w, 3) float32, the largest first.

        The confidence of all points of a face is the probability that there is a face; depths are
        from an origin near the head's middle.

        Raises:
            InputError: the process of the network ended.
        """
        pixels = srgb8(linear_rgb)
        height, width = pixels.shape[:2]
        if self._process is None:
            self._start()
        try:
            self._images.write(struct.pack("<3I", height, width, MAX_FACES))
            self._images.write(pixels.data.cast("B"))
            self._images.flush()
        except OSError as error:
            raise self._ended() from error
        count = struct.unpack("<I", self._read(4))[0]
        return [self._face() for _ in range(count)]

    def close(self) -> None:
        """End the process; the next image would start it again."""
        if self._process is not None:
            self._images.close()
            self._process.wait()
            self._answers.close()
            self._messages.close()
            self._process = None

    def __enter__(self) -> MediapipeDetector:
        return self

    def __exit__(self, *_) -> None:
        self.close()

    def _start(self) -> None:
        environment = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON")}
        environment |= {
            "OMP_NUM_THREADS": "1",
            "GLOG_minloglevel": "2",
            "TF_CPP_MIN_LOG_LEVEL": "2",
        }
        self._messages: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 (as long as the process)
        # Isolated: neither this package's folder nor its packages may be imported over there.
        self._process = subprocess.Popen(
            [str(self._python), "-I", mediapipe_runner.__file__],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._messages,
            env=environment,
        )
        assert (
            self._process.stdin is not None and self._process.stdout is not None
        )  # both are pipes
        self._images, self._answers = self._process.stdin, self._process.stdout
        if self._read(len(mediapipe_runner.MAGIC)) != mediapipe_runner.MAGIC:
            raise self._ended()

    def _face(self) -> Landmarks:
        n_points = self.landmark_set.n_points
        values = np.frombuffer(self._read(4 * (1 + 2 * n_points * 3)), "<f4").astype(np.float64)
        points, mirrored = values[1:].reshape(2, n_points, 3)
        mean = 0.5 * (points + mirrored[self.landmark_set.mirror])
        confidence = np.full(n_points, float(np.clip(values[0], 0.0, 1.0)))
        return Landmarks(mean[:, :2], confidence, True, self.landmark_set, mean[:, 2])

    def _read(self, count: int) -> bytes:
        data = self._answers.read(count)
        if len(data) < count:
            raise self._ended()
        return data

    def _ended(self) -> InputError:
        status = self._process.wait() if self._process else None
        self._messages.seek(0)
        lines = self._messages.read().decode(errors="replace").strip().splitlines()
        self._process, said = None, lines[-1] if lines else "nothing"
        return InputError(
            f"that the process of the landmark network ended with status {status} and said: {said}",
            "answers until the last image",
            "Make its environment anew with tools/setup_landmarks.sh, or set landmarks.detector to "
            "another kind.",
        )


def environment_python(environment: str | Path) -> Path:
    """The interpreter of the network's environment.

    Raises:
        InputError: there is none; the message says why where the set-up left a reason.
    """
    folder = Path(environment)
    python = folder / "bin" / "python"
    if python.is_file():
        return python
    reason = Path(f"{folder}.unavailable")
    found = "no environment of the landmark network"
    if reason.is_file():
        found += f" ({reason.read_text().strip()})"
    raise InputError(
        found,
        "a virtual environment with mediapipe 0.10.21",
        f"Run 'tools/setup_landmarks.sh {folder}' (Python 3.9 to 3.12), or set landmarks.detector to "
        "another kind.",
        path=folder,
    )
