"""The three parts of the face model that a configuration names."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from vermilion.faces.model import FaceModel
from vermilion.storage.errors import InputError


@dataclass(frozen=True)
class FaceModelSettings:
    """How finely the three parts are meshed, named as in the section `face_model`.

    Attributes:
        template_slight_open: weight of jawOpen in the neutral of the template.
        tracker_triangles: target number of the tracker's triangles.
        studio_identities, tracker_identities: identity modes.
        tracker_expressions: `all` of the face model, or `few`.
        studio_spacing_mm, template_spacing_mm: of vertices at the lips (`procedural`).
        seed: of the asymmetries of the studio's head (`procedural`).
    """

    template_slight_open: float
    tracker_triangles: int
    studio_identities: int
    tracker_identities: int
    tracker_expressions: str
    studio_spacing_mm: float
    template_spacing_mm: float
    seed: int


def build_models(
    name: str, source: str | Path | None, sha256: str | None, settings: FaceModelSettings
) -> dict[str, FaceModel]:
    """Studio, template and tracker of `procedural` or `ict` (read from `source`).

    Raises InputError for another name, or where the source cannot be read or has another checksum.
    """
    n_identities, slight_open = settings.studio_identities, settings.template_slight_open
    triangles, n_fitted = settings.tracker_triangles, settings.tracker_identities
    few = settings.tracker_expressions == "few"
    if name == "procedural":
        from vermilion.faces import procedural

        return {
            "studio": procedural.studio_model(
                settings.studio_spacing_mm, n_identities, settings.seed
            ),
            "template": procedural.template_model(
                slight_open, settings.template_spacing_mm, n_identities
            ),
            "tracker": procedural.tracker_model(triangles, n_fitted, few=few),
        }
    if name == "ict" and source:
        from vermilion.faces import ict
        from vermilion.faces.ict_archive import check_archive, read_ict

        if sha256 and Path(source).is_file():
            check_archive(source, sha256)
        data = read_ict(source, max(n_identities, n_fitted))
        return {
            "studio": ict.studio_model(data, n_identities),
            "template": ict.template_model(data, slight_open, n_identities),
            "tracker": ict.tracker_model(
                data,
                triangles,
                slight_open,
                n_fitted,
                ict.FEW_EXPRESSIONS if few else data.expression_names,
            ),
        }
    raise InputError(
        f"face model '{name}' with the source '{source or ''}'",
        "`procedural`, or `ict` with a folder or archive",
        "Correct `face_model.name` and `face_model.path`.",
    )
