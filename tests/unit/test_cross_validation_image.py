"""The image of the cross-validation curve shows each grid point where its axes say."""

import re
from xml.etree import ElementTree

import numpy as np
import pytest

from vermilion.regression.cross_validation import Curve
from vermilion.report.cross_validation import plot_curve

SVG = "{http://www.w3.org/2000/svg}"


def curve(betas):
    alphas = np.array([0.001, 0.01, 0.1, 1.0])
    rng = np.random.default_rng(3)
    errors = 0.03 + 0.002 * rng.random((len(betas), len(alphas), 4))
    freedom = np.tile(4.0 - np.arange(4.0), (len(betas), 1))
    return Curve(alphas, np.array(betas), errors, np.array([8, 8, 8, 6]), freedom)


@pytest.mark.parametrize("betas", [[0.1, 1.0, 3.0], [np.nan]])
def test_the_ring_is_where_the_axes_put_the_choice(tmp_path, betas):
    drawn = curve(betas)
    plot_curve(tmp_path / "cv.svg", "MS<a>", drawn)
    root = ElementTree.parse(tmp_path / "cv.svg").getroot()
    texts = {element.text: element for element in root.iter(SVG + "text")}
    assert "MS<a>: 4 folds, 30 frames" in texts
    assert ("affine" in texts) == bool(np.isnan(betas[0]))
    ring = [c for c in root.iter(SVG + "circle") if float(c.get("cy")) != 0][-1]
    row, column = drawn.choose()
    assert float(ring.get("cx")) == float(texts[f"{drawn.alphas[column]:g}"].get("x"))
    # Two round values of the error's axis fix its scale.
    ticks = sorted(
        (float(name), float(element.get("y")) - 4.5)
        for name, element in texts.items()
        if element.get("text-anchor") == "end" and re.fullmatch(r"[\d.]+", name)
    )
    (low, below), (high, above) = ticks[0], ticks[-1]
    there = below + (drawn.mean[row, column] - low) / (high - low) * (above - below)
    assert float(ring.get("cy")) == pytest.approx(there, abs=0.3)
