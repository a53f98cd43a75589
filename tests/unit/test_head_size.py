"""The size of a head from the distance of its pupils."""

import numpy as np
import pytest

from benchmarks.head_size import seen
from tests.heads import small_tracker
from vermilion.config.cross_checks import cross_checks
from vermilion.config.root import Configuration
from vermilion.config.takes import Take, eye_distances, read_takes
from vermilion.config.tracking import TrackingConfig
from vermilion.storage.errors import InputError
from vermilion.tracking.identity.head_size import pupil_distance_mm, sized_model
from vermilion.tracking.identity.landmark_identity import fit_identity
from vermilion.tracking.settings import identity_settings

HEADER = "subject\ttake\trole\tsource\tfirst\tlast\tfps\tsplit\teye_distance_mm\n"


def sheet(tmp_path, *distances):
    path = tmp_path / "takes.tsv"
    rows = [f"s\tt{k}\tvideo\tstudio\t0\t9\t25\tnone\t{d}\n" for k, d in enumerate(distances)]
    path.write_text(HEADER + "".join(rows))
    return read_takes(path)


@pytest.mark.parametrize("wanted", [52.0, 63.0, 71.5])
def test_a_person_has_the_measured_distance_and_nothing_but_the_size_changes(wanted):
    person = np.random.default_rng(3).normal(size=small_tracker().n_identities)
    own = sized_model(small_tracker(), person, wanted)
    assert pupil_distance_mm(own, own.neutral_of(person)) == pytest.approx(wanted, abs=1e-4)
    weights = np.random.default_rng(4).uniform(size=small_tracker().n_expressions)
    before, after = small_tracker().vertices(person, weights), own.vertices(person, weights)
    scale = wanted / pupil_distance_mm(small_tracker(), small_tracker().neutral_of(person))
    assert np.allclose(after, scale * before, atol=1e-3)  # mm: nearer by as much, no image changes


def test_the_person_found_in_landmarks_has_the_measured_distance():
    """Landmarks tell no size: fitted again in the face model of their size, the person has it."""
    cfg = TrackingConfig().model_dump(mode="json")
    settings = identity_settings(cfg["fit"], cfg["identity"])
    video = [seen(small_tracker(), small_tracker().neutral_mm, settings, np.random.default_rng(5))]
    own = sized_model(
        small_tracker(), fit_identity(small_tracker(), video, settings).identity, 70.0
    )
    found = own.neutral_of(fit_identity(own, video, settings).identity)
    assert pupil_distance_mm(own, found) == pytest.approx(70.0, abs=0.3)  # mm


def test_pupils_lie_between_the_corners_of_the_eyes():
    corners = small_tracker().neutral_mm[small_tracker().landmarks[[36, 39, 42, 45]]]
    outer, inner = (np.linalg.norm(corners[a] - corners[b]) for a, b in ((0, 3), (1, 2)))
    assert inner < pupil_distance_mm(small_tracker(), small_tracker().neutral_mm) < outer


def test_a_distance_in_centimetres_is_refused():
    with pytest.raises(InputError, match="eye_distance_mm 31, where the face model has"):
        sized_model(small_tracker(), np.zeros(small_tracker().n_identities), 31.0)


def test_one_row_tells_it_for_the_person(tmp_path):
    takes, problems = sheet(tmp_path, "", "62.5")
    assert not problems and eye_distances(takes) == {"s": 62.5}


def test_beside_a_scan_or_another_trackers_sequence_it_is_refused(tmp_path):
    takes, _ = sheet(tmp_path, "62.5")
    tracked = Take("s", "other", "tracked", "x", 0, 9, 25.0, "none", of="t0")
    scanned = Configuration(tracking={"scans": {"s": {"path": "a.obj"}}})
    said = [*cross_checks(scanned, takes), *cross_checks(Configuration(), [*takes, tracked])]
    assert any("found a scan, and eye_distance_mm 62.5" in one for one in said)
    assert any("eye_distance_mm 62.5 of subject s; expected none beside" in one for one in said)


@pytest.mark.parametrize(
    ("distances", "said"),
    [
        (
            ("62", "64"),
            "subject s: found eye_distance_mm 62 and 64; expected one distance a person",
        ),
        (
            ("6.3",),
            "eye_distance_mm: found '6.3'; expected the distance of the pupils in millimetres",
        ),
        (("wide",), "eye_distance_mm: found 'wide'; expected"),
    ],
)
def test_what_is_no_distance_is_said(tmp_path, distances, said):
    _, problems = sheet(tmp_path, *distances)
    assert len(problems) == 1 and said in problems[0]
