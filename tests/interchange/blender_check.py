"""Run by Blender's Python: opens exported files, and writes what it found as JSON.

    python blender_check.py FOLDER KIND RESULT.json

FOLDER holds the files of one mesh, with the truth beside it; KIND is usd, usd_shapes, gltf, alembic
or obj. Blender's z is up: its world is (x, -z, y) of ours, in metres where the file has a unit.
"""

import json
import sys
from pathlib import Path

import bpy
import numpy as np
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector

FILES = {
    "usd": "corrected.usdc", "usd_shapes": "corrected_shapes.usdc", "gltf": "corrected.glb",
    "alembic": "corrected.abc", "obj": "obj",
}  # fmt: skip


def open_file(path, kind, fps):
    """Import into an empty scene."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    if kind == "gltf":  # glTF counts seconds: the scene's rate says which frames they are
        scene.render.fps = round(fps)
        bpy.ops.import_scene.gltf(filepath=str(path))
    elif kind in ("usd", "usd_shapes"):
        bpy.ops.wm.usd_import(filepath=str(path), set_frame_range=True)
    elif kind == "alembic":
        scene.render.fps = round(fps)
        bpy.ops.wm.alembic_import(filepath=str(path), set_frame_range=True, scale=0.001)
    else:
        first = sorted(path.glob("*.obj"))[0]
        bpy.ops.wm.obj_import(filepath=str(first), global_scale=0.001)
    return scene


def face():
    """The mesh with the most vertices: the others are the plate's card."""
    meshes = [item for item in bpy.data.objects if item.type == "MESH"]
    return max(meshes, key=lambda item: len(item.data.vertices))


def world_vertices(item):
    """Evaluated vertices (V, 3) in Blender's world."""
    evaluated = item.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = evaluated.to_mesh()
    flat = np.empty(3 * len(mesh.vertices), dtype=np.float32)
    mesh.vertices.foreach_get("co", flat)
    local = flat.reshape(-1, 3).astype(np.float64)
    matrix = np.array(evaluated.matrix_world)
    evaluated.to_mesh_clear()
    return local @ matrix[:3, :3].T + matrix[:3, 3]


def seen_px(scene, camera, points, size):
    """Pixels (N, 2) of points (N, 3) in Blender's world."""
    scene.render.resolution_x, scene.render.resolution_y = size
    views = np.array([world_to_camera_view(scene, camera, Vector(point)) for point in points])
    return np.stack([views[:, 0] * size[0], (1 - views[:, 1]) * size[1]], axis=1)


def render_mask(scene, camera, item, size, path):
    """The face alone, white on nothing, as Cycles sees it; alpha of each pixel (h, w)."""
    for other in bpy.data.objects:
        other.hide_render = other is not item and other.type == "MESH"
    scene.camera = camera
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.max_bounces = 32, 0
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BOX", 1.0
    scene.render.film_transparent = True
    scene.render.resolution_x, scene.render.resolution_y = size
    scene.render.resolution_percentage = 100
    scene.render.image_settings.file_format = "PNG"
    scene.render.image_settings.color_mode = "RGBA"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)


def main():
    folder, kind, result = Path(sys.argv[1]), sys.argv[2], Path(sys.argv[3])
    truth = json.loads((folder.parent / "truth.json").read_text())
    expected = np.load(folder / "vertices_mm.npy").astype(np.float64)
    size = (truth["width"], truth["height"])
    scene = open_file(folder / FILES[kind], kind, truth["fps"])
    item, found = face(), {}
    cameras = [other for other in bpy.data.objects if other.type == "CAMERA"]
    found["vertices"] = len(item.data.vertices)
    found["sides"] = sorted({len(polygon.vertices) for polygon in item.data.polygons})
    found["fps"] = scene.render.fps / scene.render.fps_base
    found["first"], found["last"] = scene.frame_start, scene.frame_end
    keys = item.data.shape_keys
    found["shape_keys"] = [] if keys is None else [key.name for key in keys.key_blocks]
    found["materials"] = [slot.material.name for slot in item.material_slots if slot.material]
    found["images"] = [image.name for image in bpy.data.images if image.size[0]]
    found["uv_layers"] = len(item.data.uv_layers)
    if cameras:
        data = cameras[0].data
        found["sensor_width_mm"], found["lens_mm"] = data.sensor_width, data.lens
    frames = [truth["first"]] if kind == "obj" else range(truth["first"], truth["last"] + 1)
    errors, pixels, positions = [], [], []
    for frame in frames:
        scene.frame_set(frame)
        ours = expected[frame - truth["first"]]
        points = world_vertices(item)[: len(ours)]  # a glTF repeats vertices of seams at its end
        positions.append(points)
        back = np.stack([points[:, 0], points[:, 2], -points[:, 1]], axis=1) * 1000.0
        errors.append(float(np.linalg.norm(back - ours, axis=1).max()))
        if cameras:
            pose, k = np.array(truth["cam_from_world"]), np.array(truth["calibration"])
            local = (ours @ pose[:, :3].T + pose[:, 3]) @ k.T
            chosen = slice(None, None, 7)
            there = seen_px(scene, cameras[0], points[chosen], size)
            pixels.append(float(np.abs(there - (local[:, :2] / local[:, 2:])[chosen]).max()))
    found["error_mm"], found["error_px"] = errors, pixels
    found["moved_mm"] = float(np.abs(positions[-1] - positions[0]).max() * 1000.0)
    if cameras and kind in ("usd", "alembic") and folder.name == "tracker":
        render_mask(scene, cameras[0], item, size, result.with_suffix(".png"))
    result.write_text(json.dumps(found))


if __name__ == "__main__":
    main()
