"""A trained regressor with all that is needed to use it, and its file (HDF5, no pickle)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

import h5py
import numpy as np

import vermilion
from vermilion.geometry.mesh import topology_hash
from vermilion.regression.estimators import AffineRegressor, RBFNetwork
from vermilion.regression.kernel import KernelRegressor
from vermilion.regression.linear import LinearOutputs
from vermilion.storage.errors import ModelFileError
from vermilion.storage.files import atomic_path
from vermilion.storage.hdf5 import DAMAGE, open_hdf5

Found = TypeVar("Found")

FORMAT = "vermilion-regressor"
FORMAT_VERSION = 4
#: Displacement (mm) that weighs as much as 1 in a layer (rad), so that one basis serves both.
DISPLACEMENT_UNIT_MM = 30.0
#: What the numbers of a file are measured in, for its readers.
UNITS = {
    "unit_displacements": f"{DISPLACEMENT_UNIT_MM:g} mm",
    "unit_features": "see feature_names",
    "unit_layers": "rad, 1",
}
#: Coarse neutrals this near (RMS) are one person's: they come from one identity.npz.
SAME_PERSON_MM = 0.05
ESTIMATORS = {"rbf": RBFNetwork, "affine": AffineRegressor, "kernel": KernelRegressor}


@dataclass(frozen=True)
class LipModel:
    """A regressor from the features of a frame to the layers of the mask's triangles.

    Attributes:
        name: regressor and variant (`PS-anna`, `MS-affine`, ...).
        estimator: fitted; features (F, M') -> layers (F, T * 9), then the displacements of the
            mask's corners (F, N * 3) in units of DISPLACEMENT_UNIT_MM.
        feature_names: names of all M features of a frame.
        feature_columns: (M',) int, those that the estimator reads.
        mask: (T,) int32 triangle ids of the coarse mesh.
        topology: hash of the coarse topology.
        vertices: (N,) int32 ids of the mask's corners, ascending; none for a model of layers alone.
        training_frames: `subject/take` -> (n,) frame numbers trained on.
        neutrals_mm: subject -> (V, 3) coarse neutral of each person with a bias of their own, in the
            order of the biases; empty for one shared bias.
        shifts: (G, M) what is taken off the features of each of them, so that their neutral frames
            have the same; none for features as they are.
        neutral_features: (M,) what all neutral frames have then: their mean in the training.
        novelty_limit: `novelty` above which a frame is outside the training's span.
    """

    name: str
    estimator: LinearOutputs
    feature_names: tuple[str, ...]
    feature_columns: np.ndarray
    mask: np.ndarray
    topology: str
    training_frames: dict[str, np.ndarray]
    vertices: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.int32))
    neutrals_mm: dict[str, np.ndarray] = field(default_factory=dict)
    shifts: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    neutral_features: np.ndarray = field(default_factory=lambda: np.zeros(0))
    novelty_limit: float = np.inf

    def person_of(self, neutral_mm: np.ndarray | None) -> int | None:
        """Which person of the training has the coarse `neutral_mm` (V, 3), head frame; None for nobody."""
        if neutral_mm is None:
            return None
        for index, known in enumerate(self.neutrals_mm.values()):
            if known.shape == neutral_mm.shape:
                distance = np.linalg.norm(known - neutral_mm, axis=1)
                if np.sqrt((distance**2).mean()) < SAME_PERSON_MM:
                    return index
        return None

    def predict(self, features: np.ndarray, neutral_mm: np.ndarray | None = None) -> np.ndarray:
        """Layers (F, T, 9) of features (F, M).

        Args:
            neutral_mm: (V, 3) coarse neutral of the person (`identity.npz`), so that the identity of
                a person of the training is used again; None for somebody else.
        """
        person = self.person_of(neutral_mm)
        flat = self.estimator.predict(self._chosen(features, person), person)
        return flat[:, : 9 * len(self.mask)].reshape(len(features), -1, 9)

    def mixture(self, features: np.ndarray, neutral_mm: np.ndarray | None = None) -> np.ndarray:
        """Coefficients (F, R) of the basis, of `features` (F, M); `neutral_mm` (V, 3) as in `predict`."""
        return self.estimator.mixture(self._chosen(features, self.person_of(neutral_mm)))

    def basis(self, neutral_mm: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Layers (R + 1, T * 9) and displacements (R + 1, N * 3) mm that `mixture` mixes.

        The last row is the bias of the person with `neutral_mm` (V, 3), of which every frame has one.
        """
        bias = self.estimator.bias_of(self.person_of(neutral_mm))
        rows = np.concatenate([self.estimator.basis_, bias[None]])
        layers, places = np.split(rows, [9 * len(self.mask)], axis=1)
        return layers, DISPLACEMENT_UNIT_MM * places

    def novelty(self, features: np.ndarray, neutral_mm: np.ndarray | None = None) -> np.ndarray:
        """How far `features` (F, M) of the person with `neutral_mm` (V, 3) lie from the training, (F,)."""
        return self.estimator.novelty(self._chosen(features, self.person_of(neutral_mm)))

    def check_topology(self, triangles: np.ndarray) -> None:
        """Raise ModelFileError where a mesh's triangles (T, 3) are not those of the training."""
        found = topology_hash(triangles)
        if found != self.topology:
            raise ModelFileError(
                f"a mesh of {len(triangles)} triangles with topology {found[:12]}",
                f"the topology {self.topology[:12]} that {self.name} was trained on",
                "Track the take with the face model of the training, or train on this one.",
            )

    def _chosen(self, features: np.ndarray, person: int | None) -> np.ndarray:
        features = np.asarray(features)
        if features.ndim != 2 or features.shape[1] != len(self.feature_names):
            raise ValueError(
                f"features must be (F, {len(self.feature_names)}), got {features.shape}"
            )
        if person is not None and len(self.shifts):
            features = features - self.shifts[person]
        return features[:, self.feature_columns]


def save_model(path: str | Path, model: LipModel, *, compact: bool = False) -> None:
    """Write a model file, whole or not at all.

    `compact` keeps the basis of layers to three digits, compressed: a file that travels with the project.
    """
    kind = next(k for k, cls in ESTIMATORS.items() if isinstance(model.estimator, cls))
    with atomic_path(path) as temporary, h5py.File(temporary, "w") as file:
        file.attrs.update(
            format=FORMAT,
            format_version=FORMAT_VERSION,
            vermilion_version=vermilion.__version__,
            name=model.name,
            estimator=kind,
            topology_sha256=model.topology,
            novelty_limit=model.novelty_limit,
            **UNITS,
        )
        for setting in _settings(ESTIMATORS[kind]):
            file.attrs[setting] = getattr(model.estimator, setting)
        for name in model.estimator.FITTED:
            values = getattr(model.estimator, name)
            half = compact and name == "basis_"
            _put(
                file, f"estimator/{name.rstrip('_')}", values.astype(np.float16) if half else values
            )
        if model.estimator.feature_groups is not None:
            _put(file, "estimator/feature_groups", np.array(model.estimator.feature_groups, "S"))
        _put(file, "features/names", np.array(model.feature_names, dtype="S"))
        _put(file, "features/columns", np.asarray(model.feature_columns, dtype=np.int32))
        _put(file, "mask/triangles", np.asarray(model.mask, dtype=np.int32))
        _put(file, "mask/vertices", np.asarray(model.vertices, dtype=np.int32))
        for index, (name, neutral) in enumerate(model.neutrals_mm.items()):
            _put(file, f"persons/{name}", np.asarray(neutral, dtype=np.float64))
            file[f"persons/{name}"].attrs["index"] = index
        _put(file, "features/shifts", np.asarray(model.shifts, dtype=np.float64))
        _put(file, "features/neutral", np.asarray(model.neutral_features, dtype=np.float64))
        for name, frames in sorted(model.training_frames.items()):
            _put(file, f"training/{name}", np.asarray(frames, dtype=np.int32))


def load_model(path: str | Path) -> LipModel:
    """Read a model file.

    Raises ModelFileError, each with its own message, where the file is damaged, is no model, or
    comes from a newer version.
    """
    return _from_file(path, _read)


def model_topology(path: str | Path) -> str:
    """`topology_hash` of the mesh that a model file is for, from its header; raises as `load_model`."""
    return _from_file(path, lambda file: str(file.attrs["topology_sha256"]))


def _from_file(path: str | Path, read: Callable[[h5py.File], Found]) -> Found:
    def unreadable(why: str) -> ModelFileError:
        return ModelFileError(
            f"a truncated or damaged model file ({why})",
            "a whole file as the rule `train` wrote it",
            "Copy it again, or remove it and run again.",
            path=path,
        )

    with open_hdf5(path, unreadable) as file:
        try:
            _check_header(file, path)
            return read(file)
        except DAMAGE as error:
            raise unreadable(f"{error}") from error


def _check_header(file: h5py.File, path: str | Path) -> None:
    if file.attrs.get("format") != FORMAT:
        raise ModelFileError(
            f"an HDF5 of format {file.attrs.get('format')!r}",
            f"a regressor of Vermilion ({FORMAT!r})",
            "Give a file of the folder `models/`.",
            path=path,
        )
    version = int(file.attrs["format_version"])
    if version != FORMAT_VERSION:
        newer = version > FORMAT_VERSION
        raise ModelFileError(
            f"format version {version}, written by Vermilion {file.attrs.get('vermilion_version')}",
            f"version {FORMAT_VERSION}",
            f"{'Update Vermilion, or train' if newer else 'Train'} the regressor again with this version.",
            path=path,
        )


def _read(file: h5py.File) -> LipModel:
    kind = str(file.attrs["estimator"])
    settings = {name: file.attrs[name].item() for name in _settings(ESTIMATORS[kind])}
    if "estimator/feature_groups" in file:
        settings["feature_groups"] = _strings(file["estimator/feature_groups"])
    estimator = ESTIMATORS[kind](**settings)
    for name in estimator.FITTED:
        values = file[f"estimator/{name.rstrip('_')}"][:]
        setattr(
            estimator, name, values.astype(np.float32) if values.dtype == np.float16 else values
        )
    estimator.n_features_in_ = len(estimator.feature_mean_)
    training: dict[str, np.ndarray] = {}
    for subject, takes in file["training"].items():
        training.update({f"{subject}/{take}": frames[:] for take, frames in takes.items()})
    persons = file["persons"].items() if "persons" in file else ()
    persons = sorted(persons, key=lambda item: int(item[1].attrs["index"]))
    return LipModel(
        name=str(file.attrs["name"]),
        estimator=estimator,
        feature_names=tuple(_strings(file["features/names"])),
        feature_columns=file["features/columns"][:],
        mask=file["mask/triangles"][:],
        topology=str(file.attrs["topology_sha256"]),
        vertices=file["mask/vertices"][:],
        training_frames=training,
        neutrals_mm={name: neutral[:] for name, neutral in persons},
        shifts=file["features/shifts"][:],
        neutral_features=file["features/neutral"][:],
        novelty_limit=float(file.attrs["novelty_limit"]),
    )


def _settings(kind: type[LinearOutputs]) -> list[str]:
    """Names of the numeric parameters of an estimator."""
    return [name for name in kind().get_params() if name != "feature_groups"]


def _strings(dataset: h5py.Dataset) -> list[str]:
    return [value.decode() for value in dataset[:]]


def _put(file: h5py.File, name: str, data: np.ndarray) -> None:
    half = data.dtype == np.float16
    packed = {"compression": 9, "shuffle": True} if half else {}
    file.create_dataset(name, data=data, track_times=False, **packed)
