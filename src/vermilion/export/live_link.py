"""Weights as Live Link Face writes them: ARKit's 52 shapes by their own names, with timecode.

Unreal Engine and MetaHuman Animator read the table back. A frame's timecode is its number at the take's
rate: frame 0 is 00:00:00:00.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from vermilion.storage.files import write_text

_SIDED = {
    "Eye": ("Blink", "LookDown", "LookIn", "LookOut", "LookUp", "Squint", "Wide"),
}
#: Columns in the order of Live Link Face.
SHAPES = (
    *(f"Eye{name}Left" for name in _SIDED["Eye"]), *(f"Eye{name}Right" for name in _SIDED["Eye"]),
    "JawForward", "JawRight", "JawLeft", "JawOpen", "MouthClose", "MouthFunnel", "MouthPucker",
    "MouthRight", "MouthLeft", "MouthSmileLeft", "MouthSmileRight", "MouthFrownLeft",
    "MouthFrownRight", "MouthDimpleLeft", "MouthDimpleRight", "MouthStretchLeft",
    "MouthStretchRight", "MouthRollLower", "MouthRollUpper", "MouthShrugLower", "MouthShrugUpper",
    "MouthPressLeft", "MouthPressRight", "MouthLowerDownLeft", "MouthLowerDownRight",
    "MouthUpperUpLeft", "MouthUpperUpRight", "BrowDownLeft", "BrowDownRight", "BrowInnerUp",
    "BrowOuterUpLeft", "BrowOuterUpRight", "CheekPuff", "CheekSquintLeft", "CheekSquintRight",
    "NoseSneerLeft", "NoseSneerRight", "TongueOut",
)  # fmt: skip
_ROTATIONS = (
    "HeadYaw", "HeadPitch", "HeadRoll", "LeftEyeYaw", "LeftEyePitch", "LeftEyeRoll", "RightEyeYaw",
    "RightEyePitch", "RightEyeRoll",
)  # fmt: skip


def arkit_column(name: str) -> str | None:
    """`eyeBlink_L` -> `EyeBlinkLeft`; None for a shape that ARKit has not."""
    base = name.replace("_L", "Left").replace("_R", "Right")
    column = base[:1].upper() + base[1:]
    if column in SHAPES:
        return column
    whole = column.removesuffix("Left").removesuffix("Right")
    return whole if whole in SHAPES else None


def timecode(frame: int, fps: float) -> str:
    """`HH:MM:SS:FF.000` of a frame number at a whole number of frames a second."""
    rate = max(1, round(fps))
    seconds, frames = divmod(int(frame), rate)
    minutes, seconds = divmod(seconds, 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours % 24:02d}:{minutes:02d}:{seconds:02d}:{frames:02d}.000"


def write_live_link(
    path: str | Path,
    frames: np.ndarray,
    fps: float,
    names: Sequence[str],
    weights: np.ndarray,
    rotation: np.ndarray,
) -> None:
    """Write the table; shapes that the model has not are 0, sides of one ARKit shape their mean.

    Args:
        path: `.csv`.
        frames: (F,) frame numbers.
        fps: frames a second.
        names: K names of the face model.
        weights: (F, K).
        rotation: (F, 3, 3) of the head, y up; yaw, pitch and roll are written in radians.
    """
    sums = {column: np.zeros(len(frames)) for column in SHAPES}
    counts = dict.fromkeys(SHAPES, 0)
    for k, name in enumerate(names):
        column = arkit_column(name)
        if column is not None:
            sums[column] += weights[:, k]
            counts[column] += 1
    table = np.stack([sums[c] / max(counts[c], 1) for c in SHAPES], axis=1).clip(0, 1)
    angles = Rotation.from_matrix(rotation).as_euler("YXZ")
    eyes = np.zeros((len(frames), 6))
    values = np.concatenate([table, angles, eyes], axis=1)
    lines = [",".join(("Timecode", "BlendShapeCount", *SHAPES, *_ROTATIONS))]
    count = str(len(SHAPES) + len(_ROTATIONS))
    for frame, row in zip(frames, values, strict=True):
        lines.append(",".join([timecode(frame, fps), count, *(f"{value:.10f}" for value in row)]))
    write_text(path, "\n".join(lines) + "\n")
