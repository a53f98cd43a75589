"""Drift against the anchor: none for the true mesh, the known amount for one that has slipped."""

import numpy as np
import pandas as pd
import pytest

from tests import lip_patch
from vermilion.multiview.drift import (
    ALL,
    DriftSettings,
    NeutralImages,
    carry,
    drift_rows,
    neighbouring_cameras,
)
from vermilion.multiview.photometric import FlowMatcher
from vermilion.multiview.views import Frame, make_view
from vermilion.report.multiview_page import FrameSheet, TakeFindings, choose_frames, report_page

POSE = (0.7, 0.02)
SETTINGS = DriftSettings(scale=1.0, min_agreement=0.3, ray_stride_px=1)


def frame_of(number, vertices, missing=()):
    views = {
        name: make_view(
            camera, lip_patch.render(lip_patch.face_model(), vertices, camera, tattoo=True), 8, 0.01
        )
        for name, camera in lip_patch.cameras().items()
        if name not in missing
    }
    return Frame(number, views, dict.fromkeys(missing, "no image of this frame"))


@pytest.fixture(scope="module")
def scene():
    """The neutral's images, and those of another frame that misses a camera."""
    model, rest = lip_patch.face_model(), lip_patch.vertices_at(0.0, 0.0)
    truth = lip_patch.vertices_at(*POSE)
    return NeutralImages.of(frame_of(0, rest), rest, model), frame_of(1, truth, ["left"]), truth


def rows(origin, frame, vertices):
    carried = carry(origin, frame, vertices, FlowMatcher(), SETTINGS)
    return pd.DataFrame(drift_rows(origin, frame, carried, 1.0)).set_index("camera")


def test_the_true_mesh_does_not_drift(scene):
    found = rows(*scene)
    assert found.loc[ALL, "drift_px_vermilion"] < 0.15
    assert found.loc[ALL, "drift_mm_vermilion"] < 0.05
    assert found.loc[ALL, "measured_percent"] > 80


@pytest.mark.parametrize("slip_mm", [0.3, 0.6, 0.9])
def test_a_slip_across_the_line_of_sight_is_measured(scene, slip_mm):
    origin, frame, truth = scene
    found = rows(origin, frame, truth + np.array([slip_mm, 0.0, 0.0]))
    px_per_mm = 1500.0 / 500.0  # of the frontal camera
    assert found.loc["front", "drift_mm_vermilion"] == pytest.approx(slip_mm, abs=0.06)
    assert found.loc["front", "drift_px_vermilion"] == pytest.approx(slip_mm * px_per_mm, abs=0.2)
    still = rows(*scene)
    assert found.loc[ALL, "difference_vermilion"] > 1.3 * still.loc[ALL, "difference_vermilion"]


def test_a_camera_without_a_image_is_named(scene):
    found = rows(*scene)
    assert found.loc["left", "reason"] == "no image of this frame"
    assert np.isnan(found.loc["left", "drift_px_skin"])
    assert (found["reason"].drop("left") == "").all()


def test_neighbouring_cameras_agree_on_the_true_neutral(scene):
    origin, rest = scene[0], lip_patch.vertices_at(0.0, 0.0)
    sources = neighbouring_cameras(origin.frame, rest.mean(axis=0))
    assert all(name != source for name, source in sources.items())
    carried = carry(origin, origin.frame, rest, FlowMatcher(), SETTINGS, sources)
    found = pd.DataFrame(drift_rows(origin, origin.frame, carried, 1.0)).set_index("camera")
    assert found.loc[ALL, "drift_px_vermilion"] < 0.25


def table(n):
    return pd.DataFrame(
        {
            "frame": np.arange(n),
            "valid": 1,
            "measured_percent_drift": 90.0,
            "residual_px": np.linspace(0, 0.5, n),
            "drift_mm_vermilion": np.r_[0.0, 0.9, np.full(n - 2, 0.1)],
            "contact_vertices": 0,
        }
    )


def test_long_takes_show_a_few_frames_the_worst_among_them():
    frames = table(5000)
    frames.loc[100:200, "valid"] = 0
    frames.loc[150, "drift_mm_vermilion"] = 0.5
    frames.loc[3000, "measured_percent_drift"] = np.nan  # cannot be read
    frames.loc[3000, "residual_px"] = 9.0
    why = choose_frames(frames, neutral=0, spaced=3, flagged=2)
    assert len(why) == 8 and list(why) == sorted(why)
    assert why[0] == "neutral" and why[150] == "flagged"
    assert "drift" in why[1] and "residual" in why[4999]
    assert 3000 not in why


def test_a_take_of_a_neutral_alone_shows_it():
    assert choose_frames(pd.DataFrame(), neutral=4, spaced=3, flagged=2) == {4: "neutral"}


def test_sheets_shrink_until_the_page_keeps_to_its_size(scene):
    origin = scene[0]
    across = rows(origin, origin.frame, lip_patch.vertices_at(0.0, 0.0)).reset_index()
    found = TakeFindings("s1/rom", 0, ["front"], pd.DataFrame(), pd.DataFrame(), across)
    noise = np.random.default_rng(0).integers(0, 255, (900, 1400, 3), dtype=np.uint8)
    sheets = [FrameSheet(number, "noise", noise) for number in range(3)]
    assert len(report_page(found, sheets, page_mb=0.8)) < 0.8e6
