"""What the evaluation measures is what `apply` ships."""

from __future__ import annotations

import numpy as np
import pytest

from tests.stages.evaluation.conftest import CFG, take_inputs
from tests.stages.lip_scene import BAD_FRAME
from tests.stages.run_script import Names, script
from vermilion.config.correction import IntegrationConfig
from vermilion.correspondence.correspondence import Correspondence
from vermilion.tracking.result import TrackedTake

pytestmark = pytest.mark.slow

#: A filter over time as well: a chunk's border must not matter.
WITH_TIME = CFG | {"correction.integration": IntegrationConfig(detail_mm=10.0).model_dump()}


@pytest.mark.parametrize("regressor", ["MS", "GR-ana"])  # GR-ana is told the person's neutral
def test_evaluation_and_apply_make_the_same_bytes_of_the_same_frames(scene, regressor):
    frames = np.array([4, BAD_FRAME, 6, 11])
    model = str(scene.root / f"models/{regressor}.h5")
    inputs = Names(take_inputs(scene.root) | {"model": model, "models": [model]})
    fit = TrackedTake.load(inputs.fit)
    given = WITH_TIME, frames, 25.0
    take, applied, _ = script("apply/apply").corrected_take(inputs, scene.tracker, fit, *given)
    correspondence = Correspondence.load(inputs.correspondence)
    measured = script("evaluation/evaluate").corrected_takes(
        inputs, scene.tracker, fit, correspondence, *given, "ana"
    )[1]
    told = f"{regressor}/neutral" if regressor.startswith("GR") else regressor
    assert measured[told].corrected_mm.tobytes() == applied.tobytes()
    moved_mm = np.abs(applied - take.coarse_mm).max(axis=(1, 2))
    assert (moved_mm > 0.1).tolist() == [True, False, True, True]
    assert moved_mm[1] == 0.0  # the lost frame stays as it is
