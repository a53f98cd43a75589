"""The top of the summary page: whose figures, and what is said of them."""

import numpy as np
import pandas as pd

from vermilion.report.overview import beside, shown_regressor, three_figures

FLAGGED = pd.DataFrame(
    [
        ("tracking", "ana", "phone", 3, 0, "lost"),
        ("apply", "ana", "phone", 3, 0, "not tracked"),
        ("apply", "ana", "phone", 4, 1, "outside the training's span"),
    ],
    columns=["stage", "subject", "take", "frame", "valid", "reason"],
)


def headline(answer="better", ratio=0.8, contour=2.0):
    rows = [
        ("base", 1.5, 2.0, "", np.nan, ""),
        ("contour", contour, 0.9, "", np.nan, ""),
        ("null", 1.0, 0.7, "", np.nan, ""),
        ("PS", 0.9, 0.5, "null", 0.9, answer),
        ("MS", 0.8, 0.4, "null", ratio, answer),
    ]
    columns = ["regressor", "lip_motion_mm", "aperture_mm", "null", "over_null", "answer"]
    return pd.DataFrame(rows, columns=columns)


def test_figures_are_those_of_the_regressor_that_corrected_the_video():
    assert shown_regressor(headline(), "MS") == "MS"
    assert shown_regressor(headline(), "") == "PS"
    assert shown_regressor(headline()[:3], "MS") == ""  # nothing was trained
    (motion, opening, frames) = three_figures(headline(), FLAGGED, 20, "MS")
    assert motion[0] == "0.80 mm" and motion[1].endswith("motion, MS")
    assert motion[2] == (
        "The track alone is 1.50 mm off, one that learnt nothing 1.00 mm. Learning takes away 20 %."
    )
    assert opening[2] == "The track alone is 2.00 mm off, one that learnt nothing 0.70 mm."
    assert frames[0] == "95 %" and frames[2].startswith("1 of 20 frames could not be used")


def test_what_a_trivial_method_reaches_is_not_hidden():
    (motion, *_) = three_figures(headline("level", 0.98, contour=0.6), FLAGGED, 20, "MS")
    assert "Learning is not shown to help." in motion[2]
    assert "Contours without a regressor reach 0.60 mm." in motion[2]
    (motion, *_) = three_figures(headline("worse", 1.3), FLAGGED, 20, "MS")
    assert "What was learnt makes it 30 % worse." in motion[2]


def test_without_anything_measured_only_the_frames_are_told():
    nothing = headline()[:0]
    assert [what for _, what, _ in three_figures(nothing, FLAGGED, 20, "MS")] == [
        "of the frames were used by every stage"
    ]


def test_the_page_does_not_tell_where_the_results_lie(tmp_path):
    pages = []
    for machine in ("here", "bucket/project"):
        video = tmp_path / machine / "demo/apply/ana/phone/overlay.mp4"
        video.parent.mkdir(parents=True)
        video.write_bytes(bytes(2000))
        pages.append(
            beside([("ana/phone", video)], [], 0.001, tmp_path / machine / "demo/evaluation")
        )
    assert pages[0] == pages[1]
    assert 'href="../apply/ana/phone/overlay.mp4"><code>apply/ana/phone/overlay.mp4<' in pages[0]
