"""Model files and the database file: what is written is read, and every damage has its own error."""

from dataclasses import replace

import h5py
import numpy as np
import pytest

from vermilion.config.regressors import split_name, trained_on
from vermilion.database.read import LipDatabase
from vermilion.database.schema import SubjectEntry, TakeEntry
from vermilion.database.write import write_database
from vermilion.geometry.mesh import topology_hash
from vermilion.regression.estimators import AffineRegressor, RBFNetwork
from vermilion.regression.kernel import KernelRegressor
from vermilion.regression.model import FORMAT_VERSION, LipModel, load_model, save_model
from vermilion.regression.training import Selection, curve_table, train
from vermilion.storage.errors import InputError, ModelFileError

TRIANGLES = np.array([[0, 1, 2], [1, 3, 2], [2, 3, 4], [3, 5, 4]])
NAMES = ("shape_01", "shape_02", "outer_width", "lower_lip_1")


def neutral(seed):
    return np.random.default_rng(seed).normal(scale=30.0, size=(6, 3))


@pytest.fixture
def model():
    rng = np.random.default_rng(0)
    features, layers = rng.normal(size=(60, 3)), rng.normal(size=(60, 18)).astype(np.float32)
    persons = np.repeat([0, 1], 30)
    estimator = RBFNetwork(
        0.1, 0.3, feature_groups=["shape", "distances", "distances"], reach=0.2, fade=3.0
    )
    return LipModel(
        name="MS",
        estimator=estimator.fit(features, layers, persons, persons=persons),
        feature_names=NAMES,
        feature_columns=np.array([0, 2, 3]),
        mask=np.array([1, 2]),
        topology=topology_hash(TRIANGLES),
        training_frames={"zoe/rom": np.arange(30), "ana/rom": np.arange(5, 35)},
        neutrals_mm={"zoe": neutral(1), "ana": neutral(2)},
        shifts=np.array([[0.3, 0.0, -0.2, 0.1], [-0.3, 0.0, 0.2, -0.1]]),
        neutral_features=np.array([0.1, 0.2, 0.3, 0.4]),
    )


def test_round_trip(model, tmp_path):
    path = tmp_path / "MS.h5"
    save_model(path, model)
    read = load_model(path)
    features = np.random.default_rng(1).normal(size=(4, 4))
    for known in (None, neutral(1), neutral(2)):
        np.testing.assert_array_equal(read.predict(features, known), model.predict(features, known))
    assert read.feature_names == NAMES
    assert read.estimator.get_params() == model.estimator.get_params()
    assert list(read.neutrals_mm) == ["zoe", "ana"]
    assert set(read.training_frames) == set(model.training_frames)
    np.testing.assert_array_equal(read.training_frames["ana/rom"], np.arange(5, 35))
    np.testing.assert_array_equal(read.shifts, model.shifts)
    np.testing.assert_array_equal(read.neutral_features, model.neutral_features)


@pytest.mark.parametrize("kind", [AffineRegressor, KernelRegressor])
def test_round_trip_of_other_regressors(model, tmp_path, kind):
    rng = np.random.default_rng(0)
    fitted = kind(2.0, basis_error=0.2).fit(rng.normal(size=(60, 3)), rng.normal(size=(60, 18)))
    written = replace(model, estimator=fitted, neutrals_mm={}, novelty_limit=3.5)
    save_model(tmp_path / "a.h5", written)
    read = load_model(tmp_path / "a.h5")
    features = rng.normal(size=(4, 4))
    np.testing.assert_array_equal(read.predict(features), written.predict(features))
    np.testing.assert_array_equal(read.novelty(features), written.novelty(features))
    assert read.novelty_limit == 3.5
    assert read.estimator.get_params() == fitted.get_params()


def test_a_file_says_what_it_is_made_of(model, tmp_path):
    """For a reader without Vermilion: version, units, features, and what was trained on."""
    save_model(tmp_path / "MS.h5", model)
    with h5py.File(tmp_path / "MS.h5") as file:
        assert file.attrs["format"] == "vermilion-regressor"
        assert file.attrs["format_version"] == FORMAT_VERSION
        assert file.attrs["unit_layers"] == "rad, 1"
        assert "unit_features" in file.attrs
        assert [name.decode() for name in file["features/names"]] == list(NAMES)
        assert sorted(file["training"]) == ["ana", "zoe"]
        np.testing.assert_array_equal(file["training/zoe/rom"], np.arange(30))
        assert file.attrs["topology_sha256"] == topology_hash(TRIANGLES)


def test_an_older_file_says_so(model, tmp_path):
    save_model(tmp_path / "MS.h5", model)
    with h5py.File(tmp_path / "MS.h5", "a") as file:
        file.attrs["format_version"] = 1
    with pytest.raises(ModelFileError, match=r"format version 1, .*Train the regressor again"):
        load_model(tmp_path / "MS.h5")


def test_a_person_is_known_again_by_their_neutral(model):
    assert model.person_of(neutral(2)) == 1
    assert model.person_of(neutral(2) + 0.01) == 1  # rounding of a file
    assert model.person_of(neutral(2) + 1.0) is None
    assert model.person_of(None) is None
    features = np.zeros((1, 4))
    assert not np.allclose(model.predict(features, neutral(1)), model.predict(features, neutral(2)))


def test_novelty_grows_away_from_the_training(model):
    near = np.zeros((1, 4))
    assert model.novelty(near + 100)[0] > 10 * model.novelty(near)[0]


def test_a_newer_file_says_so(model, tmp_path):
    path = tmp_path / "MS.h5"
    save_model(path, model)
    with h5py.File(path, "a") as file:
        file.attrs["format_version"] = 99
    with pytest.raises(ModelFileError, match=r"format version 99.*Update Vermilion"):
        load_model(path)


@pytest.mark.parametrize("share", [0.05, 0.5, 0.95])
def test_a_truncated_file_says_so(model, tmp_path, share):
    path = tmp_path / "MS.h5"
    save_model(path, model)
    content = path.read_bytes()
    path.write_bytes(content[: int(len(content) * share)])
    with pytest.raises(ModelFileError, match="truncated or damaged"):
        load_model(path)


def test_another_file_says_so(tmp_path):
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file.attrs["format"] = "something"
    with pytest.raises(ModelFileError, match="format 'something'; expected a regressor"):
        load_model(tmp_path / "other.h5")


def test_another_topology_says_so(model):
    model.check_topology(TRIANGLES.astype(np.int64))
    with pytest.raises(ModelFileError, match=r"a mesh of 3 triangles.*MS was trained on"):
        model.check_topology(TRIANGLES[:3])


def test_features_of_another_number_are_refused(model):
    with pytest.raises(ValueError, match=r"features must be \(F, 4\), got \(2, 3\)"):
        model.predict(np.zeros((2, 3)))


def entry(subject, n_frames=24, n_triangles=4, n_corners=6, seed=0):
    rng = np.random.default_rng(seed)
    frames = np.arange(n_frames)
    return TakeEntry(
        subject=subject,
        take="rom",
        fps=30.0,
        split="test:20-23",
        frames=frames,
        features=rng.normal(size=(n_frames, 4)).astype(np.float32),
        layers=rng.normal(size=(n_frames, n_triangles, 9)).astype(np.float32),
        displacement_mm=rng.normal(size=(n_frames, n_corners, 3)).astype(np.float32),
        valid=frames != 3,
        train=frames < 20,
    )


@pytest.fixture
def database(tmp_path):
    """Two people; the second's mask lacks triangle 2."""
    path = tmp_path / "lips.h5"
    people = [
        SubjectEntry("ana", neutral(1), np.arange(4), np.array([0.5, 0.0, 0.0, -0.5])),
        SubjectEntry("bo", neutral(2), np.array([0, 1, 3]), np.array([-0.5, 0.0, 1.0, 0.5])),
    ]
    takes = [entry("ana"), entry("bo", n_triangles=3, seed=1)]
    write_database(path, TRIANGLES, NAMES, people, takes)
    return path


def test_the_database_keeps_the_triangles_that_all_have(database):
    with LipDatabase(database) as read:
        np.testing.assert_array_equal(read.mask, [0, 1, 3])
        np.testing.assert_array_equal(
            read.read_take("ana", "rom").layers, entry("ana").layers[:, [0, 1, 3]]
        )
        np.testing.assert_array_equal(read.vertices, np.unique(TRIANGLES[[0, 1, 3]]))
        np.testing.assert_array_equal(
            read.read_take("ana", "rom").displacement_mm, entry("ana").displacement_mm
        )
        np.testing.assert_array_equal(read.neutral_mm("bo"), neutral(2))
        np.testing.assert_array_equal(read.neutral_features("bo"), [-0.5, 0.0, 1.0, 0.5])
        assert read.feature_names == NAMES
        assert read.topology == topology_hash(TRIANGLES)


def test_a_training_set_has_valid_training_frames_only(database):
    with LipDatabase(database) as read:
        data = read.training_set(["ana", "bo"])
    assert data.features.shape == (38, 4)
    assert data.layers.shape == (38, 27)
    assert data.subjects == ("ana", "bo")
    np.testing.assert_array_equal(data.persons, np.repeat([0, 1], 19))
    assert not set(data.frames) & {3, 20, 21, 22, 23}


def test_a_mask_with_little_in_common_names_the_subject(tmp_path):
    people = [
        SubjectEntry("ana", neutral(1), np.arange(4)),
        SubjectEntry("bo", neutral(2), np.array([0])),
    ]
    with pytest.raises(InputError, match=r"subject ana.*25% are common"):
        write_database(tmp_path / "lips.h5", TRIANGLES, NAMES, people, [])
    assert not (tmp_path / "lips.h5").exists()


def test_a_failed_database_leaves_no_file(tmp_path):
    people = [SubjectEntry("ana", neutral(1), np.arange(4))]

    def takes():
        yield entry("ana")
        raise RuntimeError("killed")

    with pytest.raises(RuntimeError):
        write_database(tmp_path / "lips.h5", TRIANGLES, NAMES, people, takes())
    assert list(tmp_path.iterdir()) == []


def test_too_few_frames_name_the_subjects(database):
    with (
        LipDatabase(database) as read,
        pytest.raises(InputError, match=r"0 valid training frames of nobody"),
    ):
        read.training_set(["nobody"])


def test_training_chooses_writes_and_reads(database, tmp_path):
    with LipDatabase(database) as read:
        data = read.training_set(["ana", "bo"])
        place = (read.feature_names, read.mask, read.area_mm2, read.topology, read.vertices)
    for name in ("MS", "MS-affine", "MS-rbf", "MS-shape-only", "MS-distances-only", "MS-paper"):
        trained, curve = train(name, data, *place, Selection(folds=3, clip_frames=6))
        save_model(tmp_path / f"{name}.h5", trained)
        read = load_model(tmp_path / f"{name}.h5")
        assert read.predict(data.features, neutral(1)).shape == (38, 3, 9)
        n_places = 0 if name == "MS-paper" else 6
        assert len(read.shifts) == (0 if name == "MS-paper" else 2)
        mixture = np.column_stack([read.mixture(data.features, neutral(1)), np.ones(38)])
        layers, displacements_mm = read.basis(neutral(1))
        assert displacements_mm.shape == (len(layers), 3 * n_places)
        np.testing.assert_allclose(
            (mixture @ layers).reshape(38, 3, 9), read.predict(data.features, neutral(1)), atol=1e-5
        )
        table = curve_table(name, curve)
        assert table["chosen"].sum() == 1
        assert len(table) == curve.mean.size


def test_what_all_frames_of_a_person_have_in_common_changes_nothing(database):
    """A contour found too far out on one face, in the neutral as elsewhere."""
    with LipDatabase(database) as read:
        data = read.training_set(["ana", "bo"])
        place = (read.feature_names, read.mask, read.area_mm2, read.topology, read.vertices)
    off = np.array([0.4, -0.2, 0.8, 1.5], dtype=np.float32)
    of_bo = (data.persons == 1)[:, None] * off
    neutral_features = data.neutral_features | {"bo": data.neutral_features["bo"] + off}
    moved = replace(data, features=data.features + of_bo, neutral_features=neutral_features)
    chosen = Selection(folds=3, clip_frames=6, scaling="feature")
    asked = data.features[data.persons == 1]
    for anchor, same in (("neutral", True), ("none", False)):
        plain, _ = train("MS", data, *place, replace(chosen, anchor=anchor))
        other, _ = train("MS", moved, *place, replace(chosen, anchor=anchor))
        difference = plain.predict(asked, neutral(2)) - other.predict(asked + off, neutral(2))
        assert (np.abs(difference).max() < 1e-4) == same
        difference = plain.novelty(asked, neutral(2)) - other.novelty(asked + off, neutral(2))
        assert (np.abs(difference).max() < 1e-4) == same


def test_a_person_whose_neutral_has_no_features_is_not_shifted(database):
    with LipDatabase(database) as read:
        data = read.training_set(["ana", "bo"])
        place = (read.feature_names, read.mask, read.area_mm2, read.topology, read.vertices)
    chosen, known = Selection(folds=3, clip_frames=6), data.neutral_features
    model, _ = train("MS", replace(data, neutral_features={"ana": known["ana"]}), *place, chosen)
    np.testing.assert_array_equal(model.shifts, np.zeros((2, 4)))
    model, _ = train("MS", replace(data, neutral_features={}), *place, chosen)
    assert len(model.shifts) == 0


def test_names_of_regressors():
    assert split_name("PS-ana") == ("PS", "ana", "")
    assert split_name("GR-bo-shape-only") == ("GR", "bo", "shape-only")
    assert split_name("MS-affine") == ("MS", None, "affine")
    for wrong in ("MS-", "PS", "XX-ana", "MS-linear"):
        with pytest.raises(InputError, match=r"MS, PS-<subject>, GR-<subject> or generic"):
            split_name(wrong)
    people = ["ana", "bo", "cy"]
    assert trained_on("PS-bo", people) == ["bo"]
    assert trained_on("MS", people) == people
    assert trained_on("GR-bo", people) == ["ana", "cy"]
