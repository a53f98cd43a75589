"""Keys of earlier versions: where they are now, or why they are gone."""

from __future__ import annotations

#: Old key -> new key; a key below an old one moves with it. The first that matches counts.
MOVED = {
    "refinement.photometric": "tracking.image_fit.enabled",
    "refinement.layer": "tracking.offsets.enabled",
    "refinement.appearance": "tracking.image_fit.appearance",
    "refinement.fit": "tracking.image_fit.frame_fit",
    "refinement.join": "tracking.image_fit.join",
    "refinement.offsets": "tracking.offsets",
    "refinement.overlay_frames": "tracking.image_fit.overlay_frames",
    "refinement": "tracking.image_fit",
    "landmarks.csv": "landmarks.files",
    "landmarks.key_frames.csv": "landmarks.key_frames.files",
    "detail.shading": "detail.relief",
    "tracking.identity.pictures": "tracking.identity.images",
    "correction.picture": "correction.image",
}

_AS_DRAWN = "Contour labels count as drawn now; none is moved or left out."
_TOUCH = (
    "Lips meet where their contours do; what drew them together besides made the opening worse."
)
_FORMATS = "The formats are one list now, `apply.export.formats`, such as `[usd, obj]`."

#: Keys that are gone -> the reason.
REMOVED = {
    "correction.image.closed": _TOUCH,
    "correction.image.closed_gap_iod": _TOUCH,
    "contours.detector.label_tolerance": _AS_DRAWN,
    "contours.detector.label_reach": _AS_DRAWN,
    "apply.export.usd": _FORMATS,
    "apply.export.obj": _FORMATS,
}


def new_key(old: str) -> str | None:
    """Where a key of an earlier version is now; None where the key was never one."""
    for prefix, target in MOVED.items():
        if old == prefix or old.startswith(prefix + "."):
            return target + old[len(prefix) :]
    return None


def earlier_key(key: str) -> str | None:
    """What became of a key of an earlier version, as a sentence; None where it was never one."""
    if key in REMOVED:
        return f"expected none: this key is gone. {REMOVED[key]} Remove it."
    target = new_key(key)
    return target and f"expected {target}. Rename it."


def earlier_keys(section: object, prefix: str = "") -> dict[str, str]:
    """Key -> what became of it, of all keys of a configuration (nested mappings) that are old."""
    if not isinstance(section, dict):
        return {}
    found: dict[str, str] = {}
    for name, value in section.items():
        key = f"{prefix}{name}"
        below = earlier_keys(value, f"{key}.")
        sentence = earlier_key(key)
        if below:
            found |= below
        elif sentence is not None:
            found[key] = sentence
    return found
