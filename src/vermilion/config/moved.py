"""Keys of earlier versions, and where they are now."""

from __future__ import annotations

#: Old key -> new key; a key below an old one moves with it.
MOVED = {
    "refinement.photometric": "tracking.image_fit.enabled",
    "refinement.layer": "tracking.offsets.enabled",
    "refinement.appearance": "tracking.image_fit.appearance",
    "refinement.fit": "tracking.image_fit.frame_fit",
    "refinement.join": "tracking.image_fit.join",
    "refinement.offsets": "tracking.offsets",
    "refinement.overlay_frames": "tracking.image_fit.overlay_frames",
    "refinement": "tracking.image_fit",
    "detail.shading": "detail.relief",
    "tracking.identity.pictures": "tracking.identity.images",
    "correction.picture": "correction.image",
}


def new_key(old: str) -> str | None:
    """Where a key of an earlier version is now; None where the key was never one."""
    for prefix, target in MOVED.items():
        if old == prefix or old.startswith(prefix + "."):
            return target + old[len(prefix) :]
    return None


def moved_keys(section: object, prefix: str = "") -> dict[str, str]:
    """Old key -> new key, of all keys of a configuration (nested mappings) that have moved."""
    if not isinstance(section, dict):
        return {}
    found: dict[str, str] = {}
    for name, value in section.items():
        key = f"{prefix}{name}"
        below = moved_keys(value, f"{key}.")
        target = new_key(key)
        if below:
            found |= below
        elif target is not None:
            found[key] = target
    return found
