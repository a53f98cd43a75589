"""The three parts of the face model that a configuration names."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from vermilion.faces.model import FaceModel
from vermilion.storage.errors import InputError

#: Face model -> `topology_hash` of its tracker with the configuration's defaults: what a file that knows
#: its triangles alone is of.
TRACKER_TOPOLOGIES = {
    "procedural": "945ef30d9c8c1df6b63ae899ca02b1406a2ca37201f0b4761e7791e5875cb7e5",
    "ict": "e94cd18b2ee6e9754cee2b3409404b74b6bee926db864bbe2ead8b6b1685ce4e",
}


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

    @classmethod
    def of(cls, section: Mapping[str, Any]) -> FaceModelSettings:
        """From the values of the section `face_model`, which has other keys as well."""
        return cls(**{key.name: section[key.name] for key in fields(cls)})


def face_model_of(topology: str) -> str | None:
    """The face model whose tracker has, by default, the triangles of a `topology_hash`; None: unknown."""
    return next((name for name, known in TRACKER_TOPOLOGIES.items() if known == topology), None)


def build_models(
    name: str, source: str | Path | None, sha256: str | None, settings: FaceModelSettings
) -> dict[str, FaceModel]:
    """Studio, template and tracker of `procedural` or `ict` (read from `source`).

    Raises InputError for another name, or where the source cannot be read or has another checksum.
    """
    return {part: make() for part, make in _parts(name, source, sha256, settings).items()}


def build_tracker(name: str, source: str | Path | None, settings: FaceModelSettings) -> FaceModel:
    """The tracker alone; raises as `build_models`."""
    return _parts(name, source, None, settings)["tracker"]()


def _parts(
    name: str, source: str | Path | None, sha256: str | None, settings: FaceModelSettings
) -> dict[str, Callable[[], FaceModel]]:
    """Part -> what builds it."""
    n_identities, slight_open = settings.studio_identities, settings.template_slight_open
    triangles, n_fitted = settings.tracker_triangles, settings.tracker_identities
    few = settings.tracker_expressions == "few"
    if name == "procedural":
        from vermilion.faces import procedural

        return {
            "studio": lambda: procedural.studio_model(
                settings.studio_spacing_mm, n_identities, settings.seed
            ),
            "template": lambda: procedural.template_model(
                slight_open, settings.template_spacing_mm, n_identities
            ),
            "tracker": lambda: procedural.tracker_model(triangles, n_fitted, few=few),
        }
    if name == "ict" and source:
        from vermilion.faces import ict
        from vermilion.faces.ict_archive import check_archive, read_ict

        if sha256 and Path(source).is_file():
            check_archive(source, sha256)
        data = read_ict(source, max(n_identities, n_fitted))
        expressions = ict.FEW_EXPRESSIONS if few else data.expression_names
        return {
            "studio": lambda: ict.studio_model(data, n_identities),
            "template": lambda: ict.template_model(data, slight_open, n_identities),
            "tracker": lambda: ict.tracker_model(
                data, triangles, slight_open, n_fitted, expressions
            ),
        }
    raise InputError(
        f"face model '{name}' with the source '{source or ''}'",
        "`procedural`, or `ict` with a folder or archive",
        "Correct `face_model.name` and `face_model.path`.",
    )
