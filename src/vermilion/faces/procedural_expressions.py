"""The expressions of the generated head: ARKit names, displacements at weight 1."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from vermilion.faces.procedural_fields import JAW_AT_CORNERS, JAW_OPEN_RAD, Fields, jaw_motion
from vermilion.faces.procedural_head_mesh import loop_theta
from vermilion.faces.procedural_mouth import lip_point

#: Weight 1 of these moves the jaw bone too: opening angle and shift of the lower teeth.
JAW_MOTIONS: dict[str, tuple[float, tuple[float, float, float]]] = {
    "jawOpen": (JAW_OPEN_RAD, (0.0, 0.0, 0.0)),
    "jawForward": (0.0, (0.0, -0.6, 5.0)),
    "jawLeft": (0.0, (7.0, 0.0, 0.0)),
    "jawRight": (0.0, (-7.0, 0.0, 0.0)),
}


def jaw_motion_of(f: Fields, name: str) -> np.ndarray:
    """(V, 3) mm: the jaw bone moves as `JAW_MOTIONS` says, and the lips with it."""
    open_rad, shift = JAW_MOTIONS[name]
    narrower = -2.5 * f.u**3 * (open_rad / JAW_OPEN_RAD)  # an opening mouth draws its corners in
    return f.jaw(open_rad, shift) + f.lips(narrower, 0.0, 0.0)


def mouth_close(f: Fields) -> np.ndarray:
    """(V, 3) mm: undoes the parting of the lips by jawOpen.

    Together at weight 1 the two give closed lips and open teeth.
    """
    meeting = lip_point(loop_theta(), np.ones(len(f.u)))
    motion = jaw_motion(meeting, JAW_OPEN_RAD, (0.0, 0.0, 0.0))
    curve = (JAW_AT_CORNERS - f.jaw_loop)[:, None] * motion
    return f.lips(curve[:, 0], curve[:, 1], curve[:, 2], 30.0)


def mouth_pucker(f: Fields, rolls: bool) -> np.ndarray:
    """(V, 3) mm: the corners come together and the lips forward, as for a kiss."""
    out = f.lips(
        -11.0 * f.u * (1 - 0.1 * f.u**2),
        0.8 * f.upper - 0.4 * f.lower,
        6.5 + 2.0 * np.abs(f.u) ** 2,
        48.0,
    )
    out = out + f.thin(-0.15 * f.middle)
    return out + (f.roll(-0.3 * f.middle) if rolls else 0.0)


def mouth_funnel(f: Fields, rolls: bool) -> np.ndarray:
    """(V, 3) mm: open and rounded lips, as for a long o."""
    out = f.lips(-7.5 * f.u, 4.2 * f.upper - 6.0 * f.lower, 5.0 + 2.0 * f.u**2, 46.0)
    return out + (f.roll(-0.5 * f.middle) if rolls else 0.0)


def mouth_sideways(f: Fields, side: float) -> np.ndarray:
    """(V, 3) mm: the whole mouth to one `side` (+1: the subject's left)."""
    lead = 0.5 * (1 + side * f.u)
    return f.lips(side * (8.0 - 2.0 * lead), 1.2 * f.corner(side), -2.5 * f.corner(side), 46.0)


def mouth_smile(f: Fields, side: float) -> np.ndarray:
    """(V, 3) mm: one corner out and up, and the cheek above it (`side` +1: the subject's left)."""
    c = f.corner(side)
    lips = f.lips(
        side * 7.0 * c, 6.5 * c + 0.4 * f.upper * f.half(side), -4.5 * c - 0.6 * f.half(side), 52.0
    )
    cheek = f.bumped(side * 42, -8, 15, 13, (side * 1.0, 4.5, 3.5))
    return lips + cheek + f.thin(0.16 * f.half(side) * f.middle)


def mouth_frown(f: Fields, side: float) -> np.ndarray:
    """(V, 3) mm: one corner down."""
    c = f.corner(side)
    return f.lips(side * 1.5 * c, -7.0 * c, -1.0 * c, 40.0)


def mouth_stretch(f: Fields, side: float) -> np.ndarray:
    """(V, 3) mm: one corner outwards and back."""
    c = f.corner(side)
    lips = f.lips(side * 8.0 * c, -3.0 * c, -5.0 * c - 0.5 * f.half(side), 46.0)
    return lips + f.thin(0.18 * f.half(side) * f.middle)


def mouth_dimple(f: Fields, side: float) -> np.ndarray:
    """(V, 3) mm: one corner pulled in."""
    c = f.corner(side) ** 2
    return f.lips(side * 4.0 * c, 1.0 * c, -4.5 * c, 30.0)


def mouth_press(f: Fields, side: float, rolls: bool) -> np.ndarray:
    """(V, 3) mm: one side of the lips pressed together."""
    half = f.half(side) * f.middle
    lips = f.lips(0.0, 0.0, -1.0 * half, 22.0)
    roll = f.roll(0.25 * half) if rolls else 0.0
    return lips + roll + f.thin(0.30 * half)


def mouth_upper_up(f: Fields, side: float) -> np.ndarray:
    """(V, 3) mm: one side of the upper lip raised."""
    lift = f.half(side) * f.upper
    return f.lips(side * 0.6 * lift, 6.0 * lift, 0.8 * lift, 34.0) + f.roll(-0.15 * lift)


def mouth_lower_down(f: Fields, side: float) -> np.ndarray:
    """(V, 3) mm: one side of the lower lip lowered."""
    drop = f.half(side) * f.lower
    return f.lips(side * 0.8 * drop, -6.5 * drop, 0.5 * drop, 34.0) + f.roll(-0.12 * drop)


def mouth_roll(f: Fields, lip: np.ndarray, sign: float, inward: bool) -> np.ndarray:
    """(V, 3) mm: a lip turns about its length.

    `lip` (N_LOOP,) are its weights, `sign` is +1 for the upper lip. Inward, the red turns into the
    mouth; outward, it everts.
    """
    lip = f.widened(lip)
    if not inward:
        return f.roll(-0.5 * lip, 14.0) + f.lips(0.0, sign * 2.2 * lip, 2.0 * lip, 26.0)
    # The lower lip is fuller, and has more room before the teeth.
    angle, deeper, thinner = (1.1, -3.0, 0.26) if sign > 0 else (1.3, -4.2, 0.38)
    draw = f.lips(0.0, -sign * 0.3 * lip, deeper * lip, 22.0)
    return f.roll(angle * lip, 13.0) + draw + f.thin(thinner * lip, 12.0)


def mouth_shrug(f: Fields, lip: np.ndarray, up: float) -> np.ndarray:
    """(V, 3) mm: a lip, by its weights `lip` (N_LOOP,), raised by `up` mm."""
    return f.lips(0.0, up * lip, 1.5 * lip, 40.0)


def cheek_puff(f: Fields) -> np.ndarray:
    """(V, 3) mm: both cheeks blown up."""
    out = f.lips(0.0, 0.0, 2.0 + 2.5 * f.u**2, 40.0)
    for side in (1.0, -1.0):
        out = out + f.bumped(side * 47, -36, 15, 15, (side * 6.5, 0.0, 6.0))
    return out


def nose_sneer(f: Fields, side: float) -> np.ndarray:
    """(V, 3) mm: one wing of the nose raised, and the lip below it."""
    lift = f.half(side) * f.upper
    return f.bumped(side * 14, -8, 7, 8, (side * 0.6, 3.4, 0.6)) + f.lips(
        0.0, 2.2 * lift, 0.4 * lift, 26.0
    )


def cheek_squint(f: Fields, side: float) -> np.ndarray:
    """(V, 3) mm: one cheek raised towards the eye."""
    return f.bumped(side * 40, 3, 14, 9, (0.0, 4.0, 2.5))


def brow_inner_up(f: Fields) -> np.ndarray:
    """(V, 3) mm: the inner ends of both brows raised."""
    out = f.bumped(11, 48, 11, 8, (-0.5, 5.0, 0.6))
    return out + f.bumped(-11, 48, 11, 8, (0.5, 5.0, 0.6))


def brow_down(f: Fields, side: float) -> np.ndarray:
    """(V, 3) mm: one brow lowered."""
    return f.bumped(side * 22, 46, 14, 7, (-side * 2.2, -5.0, 0.8))


def brow_outer_up(f: Fields, side: float) -> np.ndarray:
    """(V, 3) mm: the outer end of one brow raised."""
    return f.bumped(side * 40, 46, 11, 8, (0.0, 5.0, 0.3))


def _sided(name: str, build: Callable[[Fields, float], np.ndarray]) -> dict:
    return {
        f"{name}_L": lambda f: build(f, 1.0),
        f"{name}_R": lambda f: build(f, -1.0),
    }


def _jaw(name: str) -> Callable[[Fields], np.ndarray]:
    return lambda f: jaw_motion_of(f, name)


def _library(rolls: bool) -> dict[str, Callable[[Fields], np.ndarray]]:
    shapes: dict[str, Callable[[Fields], np.ndarray]] = {name: _jaw(name) for name in JAW_MOTIONS}
    shapes["mouthClose"] = mouth_close
    shapes["mouthPucker"] = lambda f: mouth_pucker(f, rolls)
    shapes["mouthFunnel"] = lambda f: mouth_funnel(f, rolls)
    shapes["mouthLeft"] = lambda f: mouth_sideways(f, 1.0)
    shapes["mouthRight"] = lambda f: mouth_sideways(f, -1.0)
    shapes |= _sided("mouthSmile", mouth_smile)
    shapes |= _sided("mouthFrown", mouth_frown)
    shapes |= _sided("mouthStretch", mouth_stretch)
    shapes |= _sided("mouthDimple", mouth_dimple)
    shapes |= _sided("mouthPress", lambda f, side: mouth_press(f, side, rolls))
    shapes |= _sided("mouthUpperUp", mouth_upper_up)
    shapes |= _sided("mouthLowerDown", mouth_lower_down)
    shapes["mouthRollUpper"] = lambda f: mouth_roll(f, f.upper, 1.0, True)
    shapes["mouthRollLower"] = lambda f: mouth_roll(f, f.lower, -1.0, True)
    shapes["mouthRollOutUpper"] = lambda f: mouth_roll(f, f.upper, 1.0, False)
    shapes["mouthRollOutLower"] = lambda f: mouth_roll(f, f.lower, -1.0, False)
    shapes["mouthShrugUpper"] = lambda f: mouth_shrug(f, f.upper, 2.5)
    shapes["mouthShrugLower"] = lambda f: mouth_shrug(f, f.lower + 0.7 * f.upper, 1.0)
    shapes["cheekPuff"] = cheek_puff
    shapes |= _sided("cheekSquint", cheek_squint)
    shapes |= _sided("noseSneer", nose_sneer)
    shapes |= _sided("eyeBlink", lambda f, side: f.lids(side, 1.0))
    shapes |= _sided("eyeWide", lambda f, side: f.lids(side, -0.22))
    shapes["browInnerUp"] = brow_inner_up
    shapes |= _sided("browDown", brow_down)
    shapes |= _sided("browOuterUp", brow_outer_up)
    return shapes


STUDIO_SHAPES = tuple(_library(True))
#: A handicapped tracker has no rolls, press, funnel, shrugs or dimples: those are left to the correction.
TRACKER_SHAPES = tuple(
    name
    for name in STUDIO_SHAPES
    if not any(w in name for w in ("Roll", "Press", "Funnel", "Shrug", "Dimple", "Wide", "Squint"))
)


def expressions(f: Fields, names: tuple[str, ...], rolls: bool) -> np.ndarray:
    """Displacements (K, V, 3) float32 mm at weight 1; without `rolls` lips only translate."""
    library = _library(rolls)
    return np.stack([library[name](f) for name in names]).astype(np.float32)
