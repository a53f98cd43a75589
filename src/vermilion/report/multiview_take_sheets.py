"""Sheets of a take's frames: reads a frame, finds its points and its drift, draws it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd

from vermilion.faces.model import FaceModel
from vermilion.multiview.drift import (
    Carried,
    DriftSettings,
    NeutralImages,
    carry,
    drift_rows,
    neighbouring_cameras,
)
from vermilion.multiview.photometric import FlowMatcher
from vermilion.multiview.stereo import StereoSettings
from vermilion.multiview.take import MultiviewImages, RefineSettings, frame_cloud
from vermilion.multiview.views import Frame
from vermilion.report.multiview_page import FrameSheet
from vermilion.report.multiview_sheets import SheetSettings, ShownFrame, frame_sheet


@dataclass(frozen=True)
class TakeSheets:
    """Draws frames of a take whose neutral is known.

    Attributes:
        neutral_frame: its number.
        neutral_mm: (V, 3).
    """

    images: MultiviewImages
    model: FaceModel
    neutral_frame: int
    neutral_mm: np.ndarray
    stereo: StereoSettings
    refine: RefineSettings
    drift: DriftSettings
    sheet: SheetSettings
    matcher: FlowMatcher

    @cached_property
    def _neutral(self) -> Frame:
        return self.images.load(self.neutral_frame)

    @cached_property
    def _origin(self) -> NeutralImages:
        frame = self.images.at(self._neutral, self.drift.scale)
        return NeutralImages.of(frame, self.neutral_mm, self.model)

    @cached_property
    def _across(self) -> dict[str, Carried]:
        """The neutral's images, each carried to the neighbouring camera."""
        frame = self._origin.frame
        sources = neighbouring_cameras(frame, self.neutral_mm.mean(axis=0))
        return carry(self._origin, frame, self.neutral_mm, self.matcher, self.drift, sources)

    def across_rows(self) -> pd.DataFrame:
        """Rows of the neutral against the neighbouring cameras, see `drift.drift_rows`."""
        rows = drift_rows(self._origin, self._origin.frame, self._across, self.drift.scale)
        return pd.DataFrame(rows)

    def draw(
        self, number: int, why: str, mesh_mm: np.ndarray | None, seeing: np.ndarray | None
    ) -> FrameSheet:
        """A frame's sheet from its mesh and from how many cameras measured each vertex.

        `mesh_mm` (V, 3) and `seeing` (V,); the neutral needs neither. Raises InputError where the
        frame cannot be read.
        """
        if number == self.neutral_frame:
            vertices, carried, frame = self.neutral_mm, self._across, self._neutral
            seen = [sight.visible for sight in self._origin.sights.values()]
            seeing, source = np.sum(seen, axis=0), "neighbour"
        else:
            vertices, source = np.asarray(mesh_mm, dtype=np.float64), "neutral"
            frame = self.images.load(number)
            small = self.images.at(frame, self.drift.scale)
            carried = carry(self._origin, small, vertices, self.matcher, self.drift)
        cloud = frame_cloud(self.images, frame, vertices, self.model, self.stereo, self.refine)
        shown = ShownFrame(frame, vertices, np.asarray(seeing), cloud, carried)
        return FrameSheet(number, why, frame_sheet(shown, self.model, self.sheet, source))
