"""What the evaluation measures is what `apply` ships."""

from __future__ import annotations

import numpy as np
import pytest

from tests.stages.evaluation.conftest import CFG, take_inputs
from tests.stages.lip_scene import BAD_FRAME
from tests.stages.run_script import Names, script
from vermilion.config.correction import IntegrationConfig
from vermilion.correction.coarse_take import CoarseTake
from vermilion.tracking.result import Identity, TrackedTake

pytestmark = pytest.mark.slow

#: A filter over time as well: a chunk's border must not matter.
WITH_TIME = CFG | {"correction.integration": IntegrationConfig(detail_mm=10.0).model_dump()}


@pytest.mark.parametrize("regressor", ["MS", "GR-ana"])  # GR-ana is told the person's neutral
def test_evaluation_and_apply_make_the_same_bytes_of_the_same_frames(scene, regressor):
    frames = np.array([4, BAD_FRAME, 6, 11])
    inputs = take_inputs(scene.root)
    model = str(scene.root / f"models/{regressor}.h5")
    applied = script("apply/apply").corrected_take(
        Names({**inputs, "model": model}), WITH_TIME, frames, 25.0
    )[1]
    inputs = Names({**inputs, "models": [model]})
    measured = script("evaluation/evaluate").corrected_takes(inputs, WITH_TIME, frames, 25.0)[1]
    told = f"{regressor}/neutral" if regressor.startswith("GR") else regressor
    assert measured[told].corrected_mm.tobytes() == applied.tobytes()
    base = CoarseTake.load(*of_take(scene, inputs), frames).coarse_mm
    moved_mm = np.abs(applied - base).max(axis=(1, 2))
    assert (moved_mm > 0.1).tolist() == [True, False, True, True]
    assert moved_mm[1] == 0.0  # the lost frame stays as it is


def of_take(scene, inputs):
    fit = TrackedTake.load(inputs.fit)
    neutral_mm = Identity.load(inputs.identity).neutral_mm
    return scene.tracker, fit, neutral_mm, inputs.coarse, inputs.features
