"""A generic regressor: the motion of people whom it does not hold."""

import h5py
import numpy as np
import pytest

from vermilion.app.generic import ship
from vermilion.config.apply import ApplyConfig
from vermilion.config.regressors import (
    in_order,
    is_judged,
    is_variant,
    kind_of,
    split_name,
    trained_on,
)
from vermilion.database.gather import motion_mm
from vermilion.regression.model import load_model, save_model
from vermilion.regression.training import Selection, train
from vermilion.regression.training_set import TrainingSet

NAMES = ("shape_0", "shape_1", "distance_0")
#: People, frames of each, triangles of the mask, its vertices.
PEOPLE, FRAMES, TRIANGLES, VERTICES = 6, 30, 4, 6
CHOICE = Selection(kernel_alphas=(0.01, 0.1), kernel_betas=(0.3,), folds=3, basis_error=0.0)


def people(seed: int = 0) -> TrainingSet:
    """Frames of people who share a linear motion and have each a neutral of their own, far from others'."""
    rng = np.random.default_rng(seed)
    features = rng.normal(size=(PEOPLE, FRAMES, 3)).cumsum(axis=1) / 3.0
    features -= features[:, :1]
    shared = rng.normal(size=(3, 9 * TRIANGLES + 3 * VERTICES)) / 30.0
    targets = features @ shared + rng.normal(size=(PEOPLE, 1, shared.shape[1]))
    flat = targets.reshape(PEOPLE * FRAMES, -1).astype(np.float32)
    names = [f"c{k}" for k in range(PEOPLE)]
    return TrainingSet(
        features=features.reshape(-1, 3).astype(np.float32),
        layers=flat[:, : 9 * TRIANGLES],
        displacements_mm=30.0 * flat[:, 9 * TRIANGLES :],
        sequences=np.repeat(np.arange(PEOPLE), FRAMES),
        takes=tuple(f"{name}/clip" for name in names),
        frames=np.tile(np.arange(FRAMES, dtype=np.int32), PEOPLE),
        neutrals_mm={name: rng.normal(size=(8, 3)) for name in names},
        neutral_features={},
    )


@pytest.fixture(scope="module")
def model():
    mask = np.arange(TRIANGLES, dtype=np.int32)
    return train(
        "generic", people(), NAMES, mask, np.ones(TRIANGLES), "hash",
        np.arange(VERTICES, dtype=np.int32), CHOICE,
    )[0]  # fmt: skip


def test_the_neutral_of_an_unseen_person_stays_and_the_motion_is_the_shared_one(model):
    data = people()
    neutral, moved = np.zeros((1, 3)), data.features[10:11]
    assert np.abs(model.predict(neutral)).max() < 0.02
    true = (data.layers[10] - data.layers[0]).reshape(1, TRIANGLES, 9)
    off = np.abs(model.predict(moved) - true).mean()
    assert off < 0.2 * np.abs(true).mean()


def test_it_knows_nobody_of_its_training(model):
    data = people()
    assert model.neutrals_mm == {} and len(model.estimator.person_biases_) == 0
    assert model.person_of(data.neutrals_mm["c0"]) is None


def test_a_shipped_file_is_small_says_its_origin_and_predicts_the_same(model, tmp_path):
    whole, shipped = tmp_path / "whole.h5", tmp_path / "shipped.h5"
    save_model(whole, model)
    save_model(tmp_path / "made.h5", model, compact=True)
    ship(tmp_path / "made.h5", shipped, "ict", "config/generic.yaml")
    with h5py.File(shipped) as file:
        assert "ICT-FaceKit" in file.attrs["notice"] and "MIT" in file.attrs["notice"]
        assert file.attrs["configuration"] == "config/generic.yaml" and "commit" in file.attrs
        assert file["estimator/basis"].nbytes * 2 == h5py.File(whole)["estimator/basis"].nbytes
    features = people(1).features[:20]
    exact, packed = (load_model(path).predict(features) for path in (whole, shipped))
    assert packed.dtype == exact.dtype
    assert np.abs(packed - exact).max() < 2e-3 * np.abs(exact).max()


def test_a_lost_mouth_stands_out_of_a_tracks_motion_but_a_wrong_neutral_does_not():
    rng = np.random.default_rng(0)
    off_mm = rng.normal(size=(1, 50, 3)) * 20.0 + 0.3 * rng.normal(size=(9, 50, 3))
    off_mm[4, :, 1] += 10.0
    found = motion_mm(off_mm, np.ones(50))
    assert found[4] > 9.0 and np.delete(found, 4).max() < 1.0


def test_names_and_rows():
    assert split_name("generic") == ("generic", None, "")
    assert trained_on("generic", ["a", "b"]) == ["a", "b"]
    assert kind_of("GR-b5/generic") == "GR/generic"
    assert is_judged("GR-b5/generic") and not is_variant("GR-b5/generic")
    assert in_order(["MS", "GR/generic", "null", "GR"]) == ["null", "MS", "GR", "GR/generic"]


def test_generic_names_the_file_of_the_face_model_unless_another_is_given():
    assert ApplyConfig(regressor="generic").file("ict") == "models/generic-ict.h5"
    assert not ApplyConfig(regressor="generic").trains
    assert ApplyConfig(regressor="generic", model="a.h5").file("ict") == "a.h5"
    assert ApplyConfig(regressor="none").file("ict") is None
    assert ApplyConfig(regressor="MS").file("ict") is None and ApplyConfig(regressor="MS").trains
