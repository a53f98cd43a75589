"""Whether a regressor fits the face model of a clip, before anything runs."""

from __future__ import annotations

from pathlib import Path

from vermilion.app.face_files import ICT, REMEDY, VARIABLE, ModelChoice
from vermilion.config.face_model import TITLES, FaceModelConfig
from vermilion.faces.build import FaceModelSettings, build_tracker, face_model_of
from vermilion.geometry.mesh import topology_hash
from vermilion.regression.model import model_topology
from vermilion.storage.errors import VermilionError


def check_regressor(path: Path, face: ModelChoice) -> None:
    """Refuse a regressor that was trained for another face model than a clip's.

    Raises:
        VermilionError: it was; it names both.
        ModelFileError: the file is no regressor, or is damaged.
    """
    topology, name = model_topology(path), face.section["name"]
    trained_for = face_model_of(topology)
    # A model whose triangles are not the usual ones is compared with the very mesh of the clip.
    if trained_for == name or (trained_for is None and topology == _topology(face)):
        return
    known = "of other triangles" if trained_for is None else TITLES[trained_for]
    remedy = "Give a regressor that was trained for it, or leave MODEL out"
    if trained_for is not None:
        use = REMEDY if trained_for == ICT else f"`export {VARIABLE}={trained_for}` and run again"
        remedy = f"{use}, or leave MODEL out"
    raise VermilionError(
        f"{path} was trained for another face model ({known}) than that of this clip, {face.name}. {remedy}."
    )


def _topology(face: ModelChoice) -> str:
    """`topology_hash` of the tracker that the workflow builds of a face model."""
    config = FaceModelConfig.model_validate(face.section)
    settings = FaceModelSettings.of(config.model_dump())
    return topology_hash(build_tracker(config.name, config.path, settings).triangles)
