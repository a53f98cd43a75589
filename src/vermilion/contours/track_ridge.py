"""Likelihood maps where nobody labelled contours: from the tracked lips and all of a take's images.

A tracked mouth is the right one up to an error that all frames share: where the model's lips end is
not where the person's do. So what lies beside each place of the outer contour is learnt from frames
of the whole take, laid over each other along the tracked lips: the colours on either side, and how
far from the track they meet. A frame moves that border a little. The inner contour lies where what is
seen is not lip any more, looked for from where it lies on average.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.ndimage import gaussian_filter1d

from vermilion.contours.curves import (
    CURVE_POINTS,
    loop_spline,
    outward_normals,
    smoothed_halves,
    smoothed_ring,
    without_crossing,
)
from vermilion.contours.lip_heights import (
    LEAST_FRAMES,
    learn_lip_heights,
    lip_heights,
    seen_lips,
    unusual_heights,
)
from vermilion.contours.lip_planes import BESIDE
from vermilion.contours.mouth_colours import learn_lip_odds, lip_odds, not_lip, to_colours
from vermilion.contours.outer_edges import (
    STEP_PX,
    discriminants,
    edge_strength,
    normalised_strength,
    unwrapped,
)
from vermilion.contours.paths import cheapest_ring, step_cost
from vermilion.contours.region import MouthRegion, usable
from vermilion.contours.ridges import SEARCHES, RidgeDetector, blurred_colours, inner_cues
from vermilion.storage.errors import InputError
from vermilion.storage.progress import progress

ROUNDS, INNER_ROUNDS = 6, 2
NEARLY = 0.01  # a part moved as a whole meets its border so nearly, per inter-ocular distance
COLOURS_REACH = 1.5  # per the reach: the take's colours tell where to look, not how exactly
EDGE_PASSES = 6  # binomial passes over the tracked rings, whose edges are the mesh's


@dataclass(frozen=True)
class TrackRidgeDetector(RidgeDetector):
    """Ridges about the lips' borders near the tracked lips. `reach` is of the inner border.

    Attributes:
        frame_reach: how far a frame's outer border may lie from the take's, per inter-ocular distance.
        lip_reach: how far a lip or a corner as a whole may lie from there, per inter-ocular distance.
        outer_offset: (n,) the take's outer border from the tracked one, outwards, per inter-ocular
            distance.
        direction, middle: (n, 3) and (n,): a colour c at sample k is lip where
            direction[k] . c > middle[k].
        inner_offset: (m,) as `outer_offset`, of the inner border.
        lips_colours: what the take's colours count for the inner border, against those of a frame.
        lip_odds: (2, C, C, C) these colours, as of `learn_lip_odds`; (0,): not known.
        lips_heights: what an unusual height of a lip costs, against an edge.
        usual_heights: (2, K, 4) what tells the lips' heights, as of `learn_lip_heights`; (0,): not known.
        usual_width: (), of the mouth, with these, per inter-ocular distance.
    """

    kind = "track"
    from_track = True

    reach: float = 0.05
    frame_reach: float = 0.02
    lip_reach: float = 0.05
    outer_offset: np.ndarray = field(default_factory=lambda: np.zeros(0))
    direction: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    middle: np.ndarray = field(default_factory=lambda: np.zeros(0))
    inner_offset: np.ndarray = field(default_factory=lambda: np.zeros(0))
    lips_colours: float = 0.5
    lip_odds: np.ndarray = field(default_factory=lambda: np.zeros(0))
    lips_heights: float = 1.0
    usual_heights: np.ndarray = field(default_factory=lambda: np.zeros(0))
    usual_width: np.ndarray = field(default_factory=lambda: np.zeros(()))

    def region_likelihood(self, image: np.ndarray, region: MouthRegion) -> dict[str, np.ndarray]:
        """Contour -> likelihood (size, size) of a cropped `image` (size, size, 3), linear RGB."""
        colours = blurred_colours(image)
        outer, strength = self.outer_border(colours, region)
        outer = loop_spline(outer)
        strength = np.interp(
            np.arange(len(outer)) / len(outer),
            np.arange(len(strength) + 1) / len(strength),
            np.append(strength, strength[0]),
        )
        inner, inner_strength = self.inner_border(colours, region, outer)
        return {
            "inner": self.ridge(inner, inner_strength, region),
            "outer": self.ridge(outer, strength, region),
        }

    def outer_border(
        self, colours: np.ndarray, region: MouthRegion
    ) -> tuple[np.ndarray, np.ndarray]:
        """Outer border (n, 2) px near the take's, and how clear it is (n,), in `colours` (3, size, size)."""
        ring, size = smoothed_halves(region.outer_px, EDGE_PASSES), self.interocular_size_px
        count = max(int(1.5 * self.frame_reach * size / STEP_PX), 1)
        places = STEP_PX * np.arange(-count, count + 1)
        normals = outward_normals(ring)
        start = self.outer_offset * size + self.part_offsets(colours, ring)
        seen = unwrapped(colours, ring, start[:, None] + places)
        fall = normalised_strength(edge_strength(seen[None], self.direction, self.middle)[0])
        cost = (places / (self.frame_reach * size)) ** 2 - self.edge_weight * fall
        chosen = cheapest_ring(cost, step_cost(ring, STEP_PX, self.stiffness))
        offset = smoothed_ring(start + places[chosen], 2)
        return ring + offset[:, None] * normals, fall[np.arange(len(ring)), chosen]

    def part_offsets(self, colours: np.ndarray, ring: np.ndarray) -> np.ndarray:
        """How far (n,) px each lip and corner as a whole lies from the take's border in a frame.

        Rolls and presses hide a good part of a lip, and corners come in as a mouth opens wide, which
        a track does not follow: farther than a border may be looked for place by place without
        taking another edge for it. `colours` (3, size, size); `ring` (n, 2) px, region.
        """
        size = self.interocular_size_px
        reach = self.lip_reach * size
        count = max(int(1.5 * reach / STEP_PX), 1)
        places = STEP_PX * np.arange(-count, count + 1)
        offset = self.outer_offset * size
        result = np.zeros(len(ring))
        for part in mouth_parts(len(ring)):
            along = (offset + result)[:, None] + part[:, None] * places
            fall = edge_strength(
                unwrapped(colours, ring, along)[None], self.direction, self.middle
            )[0]
            near = NEARLY * size / STEP_PX
            fall = normalised_strength(gaussian_filter1d(fall, near, axis=1, mode="nearest"))
            gain = self.edge_weight * np.average(fall, axis=0, weights=part)
            result += part * places[np.argmax(gain - (places / reach) ** 2)]
        return result

    def inner_border(
        self, colours: np.ndarray, region: MouthRegion, outer: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Inner border (m, 2) px and how clear it is (m,); `colours` (3, size, size), `outer` (m, 2) px."""
        size = self.interocular_size_px
        reach = self.reach * size
        curve = loop_spline(smoothed_halves(region.inner_px, EDGE_PASSES), len(self.inner_offset))
        curve = curve + size * self.inner_offset[:, None] * outward_normals(curve)
        odds = lip_odds(self.lip_odds, colours) if len(self.lip_odds) else None
        if odds is not None:
            reach *= COLOURS_REACH
        start, strength = curve, np.zeros(len(curve))
        unusual = None
        if len(self.usual_heights):
            usual = self.usual_heights, float(self.usual_width)
            unusual = self.lips_heights * unusual_heights(usual, region, outer, size)
        for search in SEARCHES:
            cues, strange = inner_cues(colours, outer, curve, search)
            if search is SEARCHES[0]:
                start = self.to_holes(curve, replace(cues, unusual=unusual), search.step_px)
                if odds is not None:
                    planes = cues.lightness, cues.flesh, cues.lip
                    start = to_colours(start, odds, planes, size, search.step_px, unusual)
                curve = start
                cues, strange = inner_cues(colours, outer, curve, search)
            if odds is not None:
                strange = strange + self.lips_colours * (not_lip(odds, curve) - strange)
            curve, strength = self.fit_border(
                curve if search.inner_reach < 1 else start,
                strange,
                search.inner_reach * reach,
                search.step_px,
                replace(cues, unusual=unusual),
            )
        return without_crossing(curve), strength


def mouth_parts(n: int) -> np.ndarray:
    """How much each of a ring's n samples belongs to the upper and the lower lip and the corners, (4, n)."""
    along = np.sin(2 * np.pi * np.arange(n // 2) / n)
    lip, none = np.sqrt(along), np.zeros(n // 2)
    corner = np.append(np.roll(1 - along, n // 4), none)  # as if about sample n / 4
    right, left = (np.roll(corner, turn) for turn in (-(n // 4), n // 4))
    return np.stack([np.append(lip, none), np.append(none, lip), right, left])


def learn_from_take(
    detector: TrackRidgeDetector,
    frames: Iterable[int],
    read: Callable[[int], np.ndarray],
    landmarks_px: Callable[[int], np.ndarray],
    lips_px: Callable[[int], tuple[np.ndarray, np.ndarray] | None],
    reach: float,
    inner: bool = True,
) -> TrackRidgeDetector | None:
    """The detector of a take, its borders learnt from some of its frames; None where none serves.

    Args:
        detector: with the settings, no borders yet.
        frames: numbers of those to learn from; what cannot be read or has no mouth is left out.
        read: frame -> image (h, w, 3) linear RGB; landmarks_px: frame -> (66, 2); lips_px: frame ->
            outer and inner ring (n, 2) of the tracked lips.
        reach, inner: as of `learn_borders`.
    """
    images, regions = [], []
    for frame in progress(list(frames), "frames that tell the lips"):
        try:
            image = read(frame)
        except InputError:
            continue  # it is flagged where its maps are drawn
        points = landmarks_px(frame)
        if usable(points, image.shape):
            continue
        regions.append(detector.region(points, lips_px(frame)))
        images.append(regions[-1].crop(image))
    return learn_borders(detector, images, regions, reach, inner) if images else None


def learn_borders(
    detector: TrackRidgeDetector,
    images: Sequence[np.ndarray],
    regions: Sequence[MouthRegion],
    reach: float,
    inner: bool = True,
) -> TrackRidgeDetector:
    """The detector of a take, its borders learnt from some of its frames.

    Args:
        detector: with the settings, no borders yet.
        images: cropped regions (size, size, 3) linear RGB; regions: theirs, with tracked lips.
        reach: how far the outer border may lie from the tracked one, per inter-ocular distance.
        inner: whether the inner border is off by the same in all frames, as that of tracked lips. The
            ring of dense landmarks is not: what it is off by on average would close narrow openings.
    """
    size = detector.interocular_size_px
    colours = [blurred_colours(image) for image in images]
    rings = [smoothed_halves(region.outer_px, EDGE_PASSES) for region in regions]
    beside = (BESIDE[0] * size, BESIDE[1] * size)
    # A border at the end of the reach has something on either side of it all the same.
    count, more = max(int(reach * size / STEP_PX), 1), int(beside[1] / STEP_PX) + 1
    places = STEP_PX * np.arange(-count - more, count + more + 1)
    within = slice(more, -more)
    seen = np.stack([unwrapped(*pair, places) for pair in zip(colours, rings, strict=True)])
    offset = np.zeros(len(rings[0]))
    direction, middle = discriminants(seen, places, offset, beside)
    for _ in range(ROUNDS):
        fall = normalised_strength(edge_strength(seen, direction, middle).mean(axis=0)[:, within])
        cost = (places[within] / (reach * size)) ** 2 - detector.edge_weight * fall
        chosen = cheapest_ring(cost, step_cost(rings[0], STEP_PX, detector.stiffness))
        offset = smoothed_ring(places[within][chosen], 2)
        direction, middle = discriminants(seen, places, offset, beside)
    detector = replace(
        detector,
        outer_offset=offset / size, direction=direction, middle=middle, inner_offset=np.zeros(CURVE_POINTS),
    )  # fmt: skip
    outer = [
        loop_spline(detector.outer_border(*pair)[0]) for pair in zip(colours, regions, strict=True)
    ]
    return _learn_inner(detector, colours, regions, outer, inner)


def _learn_inner(
    detector: TrackRidgeDetector,
    colours: Sequence[np.ndarray],
    regions: Sequence[MouthRegion],
    outer: Sequence[np.ndarray],
    off_by_the_same: bool,
) -> TrackRidgeDetector:
    """The detector with what frames tell of the inner border; `colours` (3, size, size), `outer` (m, 2) px."""
    size = detector.interocular_size_px

    def borders() -> list[np.ndarray]:
        frames = zip(colours, regions, outer, strict=True)
        return [detector.inner_border(*frame)[0] for frame in frames]

    if not off_by_the_same:
        if detector.lips_colours:
            odds = learn_lip_odds(colours, outer, borders(), size)
            detector = replace(detector, lip_odds=odds)
        if detector.lips_heights and len(regions) >= LEAST_FRAMES:
            seen = [seen_lips(*pair, size) for pair in zip(regions, outer, strict=True)]
            found = [lip_heights(*pair) / size for pair in zip(borders(), outer, strict=True)]
            heights, width = learn_lip_heights(seen, found)
            detector = replace(detector, usual_heights=heights, usual_width=np.array(width))
        return detector
    tracked = [loop_spline(smoothed_halves(region.inner_px, EDGE_PASSES)) for region in regions]
    for _ in range(INNER_ROUNDS):
        moved = [
            ((found - ring) * outward_normals(ring)).sum(axis=1)
            for found, ring in zip(borders(), tracked, strict=True)
        ]
        detector = replace(
            detector, inner_offset=smoothed_ring(np.median(moved, axis=0), 20) / size
        )
    return detector
