"""Speed of the studio, a frame of ten 512 x 512 cameras, against named alternatives.

Prints seconds of wall clock and CPU a frame, and the ratio to ours of

- `bake per camera`: the same renderer without sharing the light between cameras;
- `trimesh rays`: primary rays alone, through trimesh's embree interface, camera by camera, against
  our primary rays alone.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import trimesh
from trimesh.ray.ray_pyembree import RayMeshIntersector

from benchmarks.common import Timed, print_table, timed
from vermilion.faces.model import FaceModel
from vermilion.faces.procedural import studio_model
from vermilion.geometry.camera import Camera
from vermilion.geometry.raycast import RayCaster
from vermilion.studio.lighting import LIGHTINGS
from vermilion.studio.look import look_of
from vermilion.studio.render import Scene, render
from vermilion.studio.rig import MULTIVIEW_CAMERAS, RigSettings, lips16_rig
from vermilion.studio.surface import surface_of

TARGET_S = 4.0


def cast_rays(model: FaceModel, cameras: dict[str, Camera]) -> None:
    """Primary rays of all pixels."""
    caster = RayCaster(model.neutral_mm, model.triangles)
    for camera in cameras.values():
        caster.see(camera)


def cast_trimesh_rays(model: FaceModel, cameras: dict[str, Camera]) -> None:
    """The same through trimesh."""
    mesh = trimesh.Trimesh(model.neutral_mm, model.triangles, process=False)
    rays = RayMeshIntersector(mesh)
    for camera in cameras.values():
        origins, directions = (a.reshape(-1, 3) for a in camera.rays(camera.pixel_grid()))
        places, _, triangles = rays.intersects_location(origins, directions, multiple_hits=False)
        trimesh.triangles.points_to_barycentric(mesh.triangles[triangles], places)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What is rendered."""
    parser.add_argument(
        "--model", type=Path, metavar="NPZ", help="face model; default: the procedural one"
    )


def run(arguments: argparse.Namespace) -> None:
    """Measure and print."""
    model = FaceModel.load(arguments.model) if arguments.model else studio_model()
    vertices = model.neutral_mm
    scene = Scene(model.triangles, surface_of(model), look_of(1, True), LIGHTINGS["rig"])
    size = (512, 512)
    settings = RigSettings(MULTIVIEW_CAMERAS, 735.0, size, size, size, 245.0, 105.0, 250.0)
    cameras = lips16_rig(model, vertices, settings)

    def each_by_itself():
        for name, camera in cameras.items():
            render(scene, vertices, {name: camera})

    frame = timed(lambda: render(scene, vertices, cameras), rounds=3, warm_up=True)
    apart = timed(each_by_itself, rounds=3)
    rays = timed(lambda: cast_rays(model, cameras), rounds=3)
    peer = timed(lambda: cast_trimesh_rays(model, cameras))

    def row(what: str, measured: Timed, ours: Timed) -> dict:
        ratio = measured.cpu_s / ours.cpu_s
        return {"what": what, "wall s": measured.wall_s, "cpu s": measured.cpu_s, "ratio": ratio}

    print(f"{model.name}: {model.n_vertices} vertices, {len(model.triangles)} triangles")
    print_table(
        [
            row("ours, ten cameras", frame, frame),
            row("bake per camera", apart, frame),
            row("ours, primary rays", rays, rays),
            row("trimesh rays", peer, rays),
        ]
    )
    met = "met" if frame.wall_s <= TARGET_S else "missed"
    print(f"target {TARGET_S:.0f} s a frame: {met} ({np.round(frame.wall_s, 2)} s)")
