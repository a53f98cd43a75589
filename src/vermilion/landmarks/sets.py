"""Sets of facial landmarks: which points there are, and what each of them is.

A detector gives the points of one set. What fits, draws or compares landmarks asks the set where the lips,
the eye corners and the jaw are. "Right" and "left" are the subject's; its right lies on the left of the image.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from vermilion.landmarks import scheme
from vermilion.storage.errors import InputError


@dataclass(frozen=True, eq=False)
class LandmarkSet:
    """N landmarks of a face.

    Attributes:
        name: which set, as files say it.
        n_points: N.
        groups: name -> (n,) points; each point is in one group. `jaw` is the line of the jaw in order
            from the right ear; it slides on the silhouette.
        deviations: name of the group -> (kind of noise that the configuration gives a deviation for,
            factor on it). Points of a dense group err together: the factor keeps the group's weight
            that of the fewer points of `ibug66`.
        lip_outer, lip_inner: (n,) closed loops from the right corner over the upper lip.
        outer_corners, inner_corners: (2,) right and left corner of the mouth on either loop.
        eye_corners: (2,) outer corner of the right and the left eye.
        mirror: (N,) point k of a mirrored image is point `mirror[k]` of the image.
        ibug66: (66,) the points that stand for those of `ibug66`.
    """

    name: str
    n_points: int
    groups: Mapping[str, np.ndarray]
    deviations: Mapping[str, tuple[str, float]]
    lip_outer: np.ndarray
    lip_inner: np.ndarray
    outer_corners: np.ndarray
    inner_corners: np.ndarray
    eye_corners: np.ndarray
    mirror: np.ndarray
    ibug66: np.ndarray

    @property
    def jaw(self) -> np.ndarray:
        """(n,) the line of the jaw, from the right ear to the left."""
        return self.groups["jaw"]

    @property
    def mouth(self) -> np.ndarray:
        """(n,) all points of the lips."""
        return self.groups["mouth"]

    @property
    def compared(self) -> np.ndarray | slice:
        """Points that errors are averaged over: those of `ibug66` but for the jaw, whatever the set."""
        n_jaw = len(scheme.JAW)
        return slice(n_jaw, None) if self.name == "ibug66" else self.ibug66[n_jaw:]

    def lip_line(self, lip: str, contour: str) -> np.ndarray:
        """(n,) points of a lip's contour from the right corner to the left, both included.

        Args:
            lip: `upper` or `lower`.
            contour: `outer` or `inner`.
        """
        outer = contour == "outer"
        loop = self.lip_outer if outer else self.lip_inner
        left = (self.outer_corners if outer else self.inner_corners)[1]
        turn = int(np.flatnonzero(loop == left)[0])
        return loop[: turn + 1] if lip == "upper" else np.append(loop[turn:], loop[0])[::-1]

    def per_point(self, noise: Mapping[str, float]) -> np.ndarray:
        """Deviations (N,) of the points, of a deviation for each kind of noise (same unit)."""
        values = np.empty(self.n_points)
        for name, points in self.groups.items():
            kind, factor = self.deviations[name]
            values[points] = factor * noise[kind]
        return values

    def interocular_px(self, points_px: np.ndarray) -> np.ndarray:
        """Distance of the outer eye corners, of points (..., N, 2): (...,) in pixels."""
        corners = points_px[..., self.eye_corners, :]
        return np.linalg.norm(corners[..., 0, :] - corners[..., 1, :], axis=-1)


def set_of(name: str) -> LandmarkSet:
    """The set of a name. Raises InputError for another name."""
    if name not in SETS:
        raise InputError(
            f"landmarks of the set '{name}'",
            f"one of {', '.join(SETS)}",
            "Find the landmarks again with this version of Vermilion.",
        )
    return SETS[name]


def _ibug66() -> LandmarkSet:
    groups = {
        "jaw": scheme.JAW,
        "brows": scheme.BROWS,
        "nose": scheme.NOSE,
        "eyes": np.concatenate([scheme.EYE_RIGHT, scheme.EYE_LEFT]),
        "mouth": scheme.MOUTH,
    }
    corners = np.array([58, 62])
    return LandmarkSet(
        name="ibug66",
        n_points=scheme.N_LANDMARKS,
        groups=groups,
        deviations={name: (name, 1.0) for name in groups},
        lip_outer=scheme.LIP_OUTER,
        lip_inner=scheme.LIP_INNER,
        outer_corners=corners,
        inner_corners=corners,
        eye_corners=scheme.EYE_CORNERS,
        mirror=scheme.MIRROR,
        ibug66=np.arange(scheme.N_LANDMARKS),
    )


#: Points of mediapipe's face mesh on the plane of symmetry. The others stand in two runs, ascending, the
#: right half of the face before the left, each in the order of the other.
_MIDLINE = (
    0, 1, 2, 4, 5, 6, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 94, 151, 152, 164, 168, 175, 195, 197, 199,
    200,
)  # fmt: skip
_N_MESH, _N_POINTS = 468, 478  # the irises are the last ten
_IRIS_MIRROR = (473, 476, 475, 474, 477, 468, 471, 470, 469, 472)

#: Right halves, each from the middle or the upper end to the right or the lower one.
_JAW_RIGHT = (162, 127, 234, 93, 132, 58, 172, 136, 150, 149, 176, 148)
_BROW_RIGHT = (70, 63, 105, 66, 107, 46, 53, 52, 65, 55)
_EYE_RIGHT = (33, 246, 161, 160, 159, 158, 157, 173, 133, 155, 154, 153, 145, 144, 163, 7)
_NOSE_RIGHT = (
    98, 97, 99, 20, 60, 75, 166, 59, 64, 48, 115, 220, 45, 44, 125, 237, 218, 79, 239, 238, 241, 242, 141, 240,
    235, 219, 102, 129, 49, 131, 134, 51, 3, 196, 122, 193, 236, 198, 174, 188, 217,
)  # fmt: skip
_NOSE_MIDDLE = (168, 6, 197, 195, 5, 4, 1, 19, 94, 2)
#: The rings of the lips from the outer contour to the inner, each half from the corner to the middle.
_UPPER_LIP = (
    (61, 185, 40, 39, 37, 0),
    (76, 184, 74, 73, 72, 11),
    (62, 183, 42, 41, 38, 12),
    (78, 191, 80, 81, 82, 13),
)
_LOWER_LIP = (
    (61, 146, 91, 181, 84, 17),
    (76, 77, 90, 180, 85, 16),
    (62, 96, 89, 179, 86, 15),
    (78, 95, 88, 178, 87, 14),
)
#: Points of the mesh where those of `ibug66` lie.
_IBUG66 = (
    162, 234, 93, 58, 172, 136, 149, 148, 152, 377, 378, 365, 397, 288, 323, 454, 389,  # jaw
    71, 63, 105, 66, 107, 336, 296, 334, 293, 301,  # brows
    168, 197, 5, 4, 75, 97, 2, 326, 305,  # nose
    33, 160, 158, 133, 153, 144, 362, 385, 387, 263, 373, 380,  # eyes
    39, 37, 0, 267, 269, 405, 314, 17, 84, 181,  # outer lips
    61, 82, 13, 312, 291, 317, 14, 87,  # corners and inner lips
)  # fmt: skip


def _mesh_mirror() -> np.ndarray:
    mirror = np.arange(_N_POINTS)
    sides = np.setdiff1d(np.arange(_N_MESH), _MIDLINE).reshape(2, -1)
    mirror[sides[0]], mirror[sides[1]] = sides[1], sides[0]
    mirror[_N_MESH:] = _IRIS_MIRROR
    return mirror


def _mediapipe478() -> LandmarkSet:
    mirror = _mesh_mirror()

    def line(half) -> np.ndarray:
        """From the right end over a midpoint, the last of `half`, to the left end."""
        half = np.array(half)
        return np.concatenate([half, mirror[half[-2::-1]]])

    def ring(upper, lower) -> np.ndarray:
        return np.concatenate([line(upper), line(lower)[-2:0:-1]])

    def both(half) -> np.ndarray:
        return np.concatenate([half, mirror[np.array(half)]])

    rings = [ring(upper, lower) for upper, lower in zip(_UPPER_LIP, _LOWER_LIP, strict=True)]
    groups = {
        "jaw": line((*_JAW_RIGHT, 152)),
        "brows": both(_BROW_RIGHT),
        "nose": np.concatenate([_NOSE_MIDDLE, both(_NOSE_RIGHT)]),
        "eyes": both(_EYE_RIGHT),
        "irises": np.arange(_N_MESH, _N_POINTS),
        "mouth": np.concatenate(rings),
    }
    named = np.concatenate(list(groups.values()))
    groups["skin"] = np.setdiff1d(np.arange(_N_POINTS), named)
    few = {name: len(points) for name, points in IBUG66.groups.items()}
    few |= {"irises": 2, "skin": 17}
    kinds = {"irises": "eyes", "skin": "jaw"}
    return LandmarkSet(
        name="mediapipe478",
        n_points=_N_POINTS,
        groups=groups,
        deviations={
            name: (kinds.get(name, name), float(np.sqrt(len(points) / few[name])))
            for name, points in groups.items()
        },
        lip_outer=rings[0],
        lip_inner=rings[-1],
        outer_corners=rings[0][[0, len(rings[0]) // 2]],
        inner_corners=rings[-1][[0, len(rings[-1]) // 2]],
        eye_corners=np.array([33, 263]),
        mirror=mirror,
        ibug66=np.array(_IBUG66),
    )


IBUG66 = _ibug66()
#: The attention mesh of mediapipe: 468 points of the face and five of each iris, the pupil first.
MEDIAPIPE478 = _mediapipe478()
SETS = {entry.name: entry for entry in (IBUG66, MEDIAPIPE478)}
