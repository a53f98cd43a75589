"""How large blend weights usually are, by what they do.

Landmarks hardly tell a mouth drawn to one side from a head that turns, or pursed lips from a jaw pushed
forward. With one deviation for all shapes, a fit explains errors of pose and shape by large weights of
shapes that people seldom use, opposite ones together.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

LIDS = ("eyeBlink",)
#: Hardly used while people speak: under 0.1 in recordings of ARKit weights, root mean square.
SIDEWAYS = ("jawLeft", "jawRight", "mouthLeft", "mouthRight")
#: Seldom used, or little: 0.1 to 0.2.
RARE = ("jawForward", "cheekPuff", "mouthRoll", "mouthPress", "mouthDimple")


class WeightPrior(Protocol):
    """What is known of blend weights.

    Attributes:
        weight_sigma: deviation of most weights about zero.
        lid_weight_sigma: of closing lids, where larger: blinks are none too rare.
        side_weight_share, rare_weight_share: of the shapes of `SIDEWAYS` and `RARE`, as a share of
            `weight_sigma`.
    """

    @property
    def weight_sigma(self) -> float: ...
    @property
    def lid_weight_sigma(self) -> float: ...
    @property
    def side_weight_share(self) -> float: ...
    @property
    def rare_weight_share(self) -> float: ...


def weight_sigmas(names: Sequence[str], n_weights: int, prior: WeightPrior) -> np.ndarray:
    """Deviations (K,) of K = `n_weights` blend weights about zero; `names` (ARKit) of the shapes, or none."""
    result = np.full(n_weights, float(prior.weight_sigma))
    for k, name in enumerate(names):
        if name.startswith(LIDS):
            result[k] = max(prior.lid_weight_sigma, prior.weight_sigma)
        elif name.startswith(SIDEWAYS):
            result[k] *= prior.side_weight_share
        elif name.startswith(RARE):
            result[k] *= prior.rare_weight_share
    return result
