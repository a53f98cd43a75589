"""The three parts of the face model that a configuration names."""

from __future__ import annotations

from pathlib import Path

from vermilion.faces.model import FaceModel
from vermilion.storage.errors import InputError


def build_models(
    name: str,
    *,
    source: str | Path | None,
    sha256: str | None,
    slight_open: float,
    tracker_triangles: int,
    studio_identities: int,
    tracker_identities: int,
    studio_spacing_mm: float,
    template_spacing_mm: float,
    seed: int,
) -> dict[str, FaceModel]:
    """Studio, template and tracker of `procedural` or `ict` (read from `source`).

    Raises InputError for another name, or where the source cannot be read or has another checksum.
    """
    if name == "procedural":
        from vermilion.faces import procedural

        return {
            "studio": procedural.studio_model(studio_spacing_mm, studio_identities, seed),
            "template": procedural.template_model(
                slight_open, template_spacing_mm, studio_identities
            ),
            "tracker": procedural.tracker_model(tracker_triangles, tracker_identities),
        }
    if name == "ict" and source:
        from vermilion.faces import ict
        from vermilion.faces.ict_archive import check_archive, read_ict

        if sha256 and Path(source).is_file():
            check_archive(source, sha256)
        data = read_ict(source, max(studio_identities, tracker_identities))
        return {
            "studio": ict.studio_model(data, studio_identities),
            "template": ict.template_model(data, slight_open, studio_identities),
            "tracker": ict.tracker_model(data, tracker_triangles, slight_open, tracker_identities),
        }
    raise InputError(
        f"face model '{name}' with the source '{source or ''}'",
        "`procedural`, or `ict` with a folder or archive",
        "Correct `face_model.name` and `face_model.path`.",
    )
