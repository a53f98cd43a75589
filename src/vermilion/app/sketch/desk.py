"""One take on the desk: all that the page's addresses ask for."""

from __future__ import annotations

from typing import Any

import numpy as np

from vermilion.app.sketch.frame_solver import FrameSolver
from vermilion.app.sketch.frame_views import FrameViews
from vermilion.app.sketch.lip_lines import LipLines
from vermilion.app.sketch.propagation_run import PropagationRun
from vermilion.app.sketch.refusal import RefusedRequest, field
from vermilion.app.sketch.sketch_store import SketchStore
from vermilion.app.sketch.take_data import TakeData
from vermilion.app.sketch.take_files import TakeFiles
from vermilion.app.sketch.take_status import TakeStatus
from vermilion.guided.magnet import snap_to_contour
from vermilion.guided.silhouette import ContourSurface
from vermilion.guided.sketch import CURVE_NAMES, KINDS, MOST_POINTS, sketch_of_json

LAYERS = ("base", "refined", "propagated")


class Desk:
    """The state of the server.

    Attributes:
        data, store, solver, views, status, run: its parts.
    """

    def __init__(self, files: TakeFiles, options: list[str] | None = None):
        """`options`: of Snakemake, for propagation. Raises InputError where nothing can be shown."""
        self.data = data = TakeData(files)
        sizes = {name: (c.width_px, c.height_px) for name, c in data.cameras.items()}
        self.store = SketchStore(files.labels, sizes, data.frames)
        surface = ContourSurface.of_face(data.face, data.regions)
        self._lines = LipLines(data.face, surface)
        self.solver = FrameSolver(data, surface, self.store)
        self.views = FrameViews(data, self._lines)
        self.status = TakeStatus(data, self.store, self.solver, self._lines)
        self.run = PropagationRun(files.configuration, files.targets, options or [])

    def description(self) -> dict[str, Any]:
        """What does not change while the page is open."""
        files, data = self.data.files, self.data
        tracked = data.fit.camera.name
        names = sorted(data.cameras, key=lambda name: (name != tracked, name))
        return {
            "take": files.take.name,
            "sequence": files.sequence,
            "first": data.frames[0],
            "last": data.frames[-1],
            "fps": files.take.fps,
            "cameras": [
                {
                    "name": name,
                    "width": data.cameras[name].width_px,
                    "height": data.cameras[name].height_px,
                    "magnet": name == tracked and data.has_maps,
                }
                for name in names
            ],
            "curves": CURVE_NAMES,
            "kinds": KINDS,
            "most_points": MOST_POINTS,
        }

    def mesh(self, layer: str, camera: str, frame: int) -> bytes:
        """A packet of one layer of a frame. Raises RefusedRequest (404) where there is none."""
        self.data.camera(camera)
        base = self.data.base(frame)
        if layer not in LAYERS:
            raise RefusedRequest(
                404, f"There is no layer {layer:.60}; there are {', '.join(LAYERS)}."
            )
        makers = {"refined": self.solver.refined, "propagated": self.data.propagated}
        mesh = makers[layer](frame) if layer in makers else base
        return self.views.mesh(mesh, base, camera)

    def curve(self, name: str, camera: str, frame: int) -> np.ndarray:
        """A contour of the mesh to start a sketch from, (n, 2) px. Raises RefusedRequest (404)."""
        if name not in CURVE_NAMES:
            raise RefusedRequest(404, f"There is no curve {name:.60}.")
        seen_by = self.data.camera(camera)
        found = self._lines.curve(name, self.data.base(frame), seen_by)
        if found is None or not seen_by.in_image(found).all():
            raise RefusedRequest(
                404, f"Camera {camera} does not see this contour in frame {frame}."
            )
        return found

    def sketch(self, camera: str, frame: int) -> dict[str, Any]:
        """The sketch of a frame in a camera with its revision, as the page reads it."""
        stored = self.store.read(camera, frame)
        curves = None
        if stored.sketch is not None:
            curves = {
                name: {
                    "kind": curve.kind,
                    "points": curve.points_px.tolist(),
                    "handles": None if curve.handles_px is None else curve.handles_px.tolist(),
                }
                for name, curve in stored.sketch.curves.items()
            }
        return {
            "revision": stored.revision, "curves": curves, "problem": stored.problem,
            "solved": self.solver.summary(frame),
        }  # fmt: skip

    def snapped(self, camera: str, frame: int, content: dict[str, Any]) -> np.ndarray:
        """A stroke pulled onto the detected contour, (n, 2) px. Raises RefusedRequest, InputError."""
        seen_by = self.data.camera(camera)
        name = field(content, "curve", str, f"one of {', '.join(CURVE_NAMES)}")
        stroke = {
            "format": "vermilion sketch", "version": 1, "unit": "px", "camera": camera,
            "frame": frame, "image_size_px": [seen_by.width_px, seen_by.height_px],
            "curves": {name: {"kind": "sure", "points": content.get("points")}},
        }  # fmt: skip
        points = sketch_of_json(stroke).curves[name].points_px
        part = "outer" if name.endswith("outer") else "inner"
        return snap_to_contour(points, self.data.likelihood(camera, frame, part))

    def jobs(self) -> dict[str, int]:
        """Rule -> jobs that a propagation would start. Raises RefusedRequest without a sketch."""
        self.need_sketches()
        return self.run.jobs()

    def need_sketches(self) -> None:
        """Raises RefusedRequest (422) where no frame of the take is drawn."""
        if not self.store.revisions():
            raise RefusedRequest(422, "No frame is drawn yet: draw the lips on one or more first.")
