"""Speed of the studio: a frame of ten 512 x 512 cameras, against named alternatives in one run.

    python benchmarks/bench_studio.py [face model .npz]

Prints a table: seconds of wall clock and CPU a frame, and the ratio to ours of

- `bake per camera`: the same renderer without sharing the light between cameras;
- `trimesh rays`: primary rays alone, through trimesh's embree interface, camera by camera, against
  our primary rays alone.
"""

from __future__ import annotations

import sys
import time

import numpy as np

from vermilion.faces.model import FaceModel
from vermilion.geometry.raycast import RayCaster
from vermilion.studio.lighting import LIGHTINGS
from vermilion.studio.look import look_of
from vermilion.studio.render import Scene, render
from vermilion.studio.rig import lips16_rig
from vermilion.studio.surface import surface_of

TARGET_S = 4.0


def seconds(task, repeats: int = 3) -> tuple[float, float]:
    """Best wall clock and CPU seconds of a task."""
    times = []
    for _ in range(repeats):
        wall, cpu = time.perf_counter(), time.process_time()
        task()
        times.append((time.perf_counter() - wall, time.process_time() - cpu))
    return min(t[0] for t in times), min(t[1] for t in times)


def main() -> None:
    if len(sys.argv) > 1:
        model = FaceModel.load(sys.argv[1])
    else:
        from vermilion.faces.procedural import studio_model

        model = studio_model()
    vertices = model.neutral_mm
    scene = Scene(model.triangles, surface_of(model), look_of(1, True), LIGHTINGS["rig"])
    cameras = lips16_rig(model, vertices, 735.0, (512, 512), (512, 512), 245.0, 105.0)
    render(scene, vertices, cameras)  # compiles

    def ours():
        render(scene, vertices, cameras)

    def apart():
        for name, camera in cameras.items():
            render(scene, vertices, {name: camera})

    def our_rays():
        caster = RayCaster(vertices, model.triangles)
        for camera in cameras.values():
            caster.see(camera)

    def trimesh_rays():
        import trimesh
        from trimesh.ray.ray_pyembree import RayMeshIntersector

        mesh = trimesh.Trimesh(vertices, model.triangles, process=False)
        rays = RayMeshIntersector(mesh)
        for camera in cameras.values():
            origins, directions = camera.rays(camera.pixel_grid())
            origins, directions = origins.reshape(-1, 3), directions.reshape(-1, 3)
            places, _, triangles = rays.intersects_location(
                origins, directions, multiple_hits=False
            )
            trimesh.triangles.points_to_barycentric(mesh.triangles[triangles], places)

    frame, rays = seconds(ours), seconds(our_rays)
    rows = [
        ("ours, ten cameras", frame, 1.0),
        ("bake per camera", per := seconds(apart), per[1] / frame[1]),
        ("ours, primary rays", rays, 1.0),
        ("trimesh rays", by := seconds(trimesh_rays, 1), by[1] / rays[1]),
    ]
    print(f"{model.name}: {model.n_vertices} vertices, {len(model.triangles)} triangles")
    print("what\twall_s\tcpu_s\tratio_cpu")
    for what, (wall, cpu), ratio in rows:
        print(f"{what}\t{wall:.2f}\t{cpu:.2f}\t{ratio:.2f}")
    met = "met" if frame[0] <= TARGET_S else "missed"
    print(f"target {TARGET_S:.0f} s a frame: {met} ({np.round(frame[0], 2)} s)")


if __name__ == "__main__":
    main()
