"""The jobs of the multiview stage on a tiny capture of three cameras, from files to files."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from tests import lip_patch
from tests.stages.run_script import run_script
from vermilion.config.multiview import MultiviewConfig
from vermilion.geometry.camera import write_cameras
from vermilion.geometry.mesh import vertex_normals
from vermilion.imaging.images import write_image

POSES = [(0.0, 0.0), (0.7, 0.02), (1.5, 0.05), (2.2, 0.1)]
LOST = {(2, "left")}  # a frame that a camera misses
PLACE = {"subject": "s1", "take": "rom"}

#: Sizes for images of 240 x 180; the sheet is small, so that little of it is hidden.
SETTINGS = MultiviewConfig(
    stereo={"reach_mm": 30, "speckle_px": 50},
    neutral={"first_gate_mm": 6, "last_gate_mm": 2, "rounds": 5, "poisson_depth": 6},
    # the small mouth fills the images, so that frames look less alike
    track={"scale": 1.0, "anchor_similarity": 0.2},
    refine={"scales": [1.0, 1.0], "cloud_scale": 1.0},
)
CFG = {f"multiview.{key}": value for key, value in SETTINGS.model_dump(mode="json").items()}


def make_capture(root, rig, lost=(), save=None, placed=lambda vertices: vertices, marks_mm=0):
    """Images, cameras, landmarks and a template that is of another face, of four frames.

    `save(image, camera, folder, stem)` writes an image; PNG by default. `placed(vertices)` is
    where the head is; landmarks are marked `marks_mm` beside their places.
    """
    person = lip_patch.face_model()
    write_cameras(root / "cameras", rig)
    for frame, pose in enumerate(POSES):
        vertices = placed(lip_patch.vertices_at(*pose))
        for name, camera in rig.items():
            if (frame, name) in lost:
                continue
            image = lip_patch.render(person, vertices, camera, tattoo=True)
            folder, stem = root / f"rom/frames/{name}", f"{frame:06d}"
            if save is None:
                write_image(folder / f"{stem}.png", image)
            else:
                save(image, name, folder, stem)
    rows = np.repeat([lip_patch.LIP_ROWS, 19, 26], 22)
    columns = np.tile(np.linspace(0, lip_patch.COLUMNS, 22, endpoint=False).astype(int), 3)
    landmarks = (rows * lip_patch.COLUMNS + columns).astype(np.int32)
    wrong = person.neutral_mm * [1.04, 0.97, 1.1] + [0.3, -0.2, 0.5]
    replace(person, neutral_mm=wrong, landmarks=landmarks).save(root / "template.npz")
    noise = np.random.default_rng(0).normal(0, 0.5, (len(rig), 66, 2))
    marked = placed(person.neutral_mm[landmarks] + marks_mm)
    points = np.stack([c.project(marked) for c in rig.values()]) + noise
    confidence = np.full((len(rig), 66), 0.9)
    np.savez(
        root / "views.npz", cameras=np.array(list(rig)), points_px=points, confidence=confidence
    )


def reconstruct(root):
    """All jobs of the stage, with one clip and one chunk."""
    neutral(root)
    track(root)
    refine(root, [0, 1, 2, 3], "000000-000003")


def inputs(root):
    return {
        "template": root / "template.npz",
        "cameras": root / "cameras",
        "landmarks": root / "views.npz",
        "neutral": root / "neutral.npz",
        "track": root / "track.npz",
    }


def neutral(root):
    run_script(
        "multiview/multiview_neutral",
        wildcards=PLACE,
        params={"cfg": CFG, "source": str(root / "rom"), "frame": 0, "first": {}},
        input=inputs(root),
        output={
            "neutral": root / "neutral.npz",
            "cloud": root / "cloud_neutral.ply",
            "surface": root / "surface_neutral.ply",
            "overlay": root / "neutral.png",
        },
    )


def track(root):
    """The coarse track, of one clip."""
    join(root, [clip(root, 0, [])], [])


def anchors(root, windows, source="rom"):
    """Anchors 1, 2, ... of windows of frames."""
    paths = []
    for index, window in enumerate(windows, start=1):
        paths.append(root / f"anchors/{source}/{index:04d}.npz")
        run_script(
            "multiview/multiview_anchor",
            wildcards={**PLACE, "clip": f"{index:04d}"},
            params={"cfg": CFG, "source": str(root / source), "neutral": 0, "window": window},
            input=inputs(root),
            output={"anchor": paths[-1]},
        )
    return paths


def clip(root, index, anchors, source="rom"):
    path = root / f"clips/{source}/{len(anchors)}/{index:04d}.npz"
    run_script(
        "multiview/multiview_clip",
        wildcards={**PLACE, "clip": f"{index:04d}"},
        params={"cfg": CFG, "source": str(root / source), "frames": [0, 3]},
        input={**inputs(root), "anchors": anchors},
        output={"clip": path},
    )
    return path


def join(root, clips, anchors, name="track"):
    run_script(
        "multiview/multiview_track",
        wildcards=PLACE,
        params={},
        input={**inputs(root), "clips": clips, "anchors": anchors},
        output={"track": root / f"{name}.npz", "topology": root / "topology.ply"},
    )


def refine(root, frames, chunk, source="rom"):
    run_script(
        "multiview/multiview_refine",
        wildcards={**PLACE, "chunk": chunk},
        params={"cfg": CFG, "source": str(root / source), "neutral": 0, "frames": frames},
        input=inputs(root),
        output={
            "meshes": root / f"H/{chunk}.npy",
            "visibility": root / f"visibility/{chunk}.npy",
            "quality": root / f"quality/{chunk}.tsv",
            "overlay": root / f"overlay/{chunk}.png",
        },
    )


def surface_error_mm(vertices, pose):
    """Distance of true vertices of the lips and skin to the mesh, along its normals."""
    model = lip_patch.face_model()
    truth = lip_patch.vertices_at(*pose)
    shown = ~model.regions["mouth_inner"] & (np.arange(len(truth)) < 26 * lip_patch.COLUMNS)
    normals = vertex_normals(vertices, model.triangles)
    _, near = cKDTree(vertices).query(truth[shown])
    return np.abs(((truth[shown] - vertices[near]) * normals[near]).sum(axis=1))
