"""Likelihood maps where nobody labelled contours: from the landmarks' lip loops and the image.

The spline through each loop is moved to the border of the lips' colour. What is lip-coloured is
learnt in each frame by itself, from the band between the loops; then again between the borders that
were found, where shade and gloss are the lips' own and not those of a landmark that missed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vermilion.contours.curves import inside_of, loop_spline
from vermilion.contours.lip_planes import lip_planes
from vermilion.contours.region import MouthRegion
from vermilion.contours.ridges import SEARCHES, RidgeDetector, blurred_colours, cues_of


@dataclass(frozen=True)
class LandmarkRidgeDetector(RidgeDetector):
    """Ridges about the lips' borders near the landmarks."""

    kind = "landmarks"

    def region_likelihood(self, image: np.ndarray, region: MouthRegion) -> dict[str, np.ndarray]:
        """Contour -> likelihood (size, size) of a cropped `image` (size, size, 3), linear RGB."""
        colours = blurred_colours(image)
        landmarks = {"inner": loop_spline(region.inner_px), "outer": loop_spline(region.outer_px)}
        reach = self.reach * self.interocular_size_px
        curves, strengths = dict(landmarks), {}
        for search in SEARCHES:
            planes = lip_planes(colours, curves, search.band, search.tolerance, search.beside)
            curves["outer"], strengths["outer"] = self.fit_border(
                curves["outer"], planes["outer"], search.outer_reach * reach, search.step_px
            )
            lip = inside_of(curves["outer"], region.size_px).astype(np.float32)
            cues = cues_of(colours, planes["flesh"], lip)
            if search is SEARCHES[0]:
                landmarks["inner"] = self.to_holes(landmarks["inner"], cues, search.step_px)
            curves["inner"], strengths["inner"] = self.fit_border(
                curves["inner"] if search.inner_reach < 1 else landmarks["inner"],
                planes["inner"],
                search.inner_reach * reach,
                search.step_px,
                cues,
            )
        return {name: self.ridge(curves[name], strengths[name], region) for name in curves}
