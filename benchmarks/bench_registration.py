"""Our dense registration of the neutral against `trimesh.registration.nricp_amberg` on the same input.

    python benchmarks/bench_registration.py RESULTS SUBJECT TAKE CAPTURE TRUTH

RESULTS is the results folder of a finished run (its template, cameras and landmarks are read), TRUTH
a folder with vertices_mm.npy and triangles.npy in the same world. Both start from the template as it
lies on the triangulated landmarks; both get the same stereo points of the take's first frame, ours as
points, the peer as points and as their Poisson surface (nearest vertices with normals, its default
steps and landmarks). Polishing by photo-consistency is left out; its result is shown for reference.

Figures over template vertices of the skin that lie within 3 mm of a stereo point: distance to the true
surface (mm), to the stereo points' surface (mm), share of triangles that turned over (normals against
the start's by more than 90 degrees), wall seconds.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import cv2
import numpy as np
import trimesh
from scipy.spatial import cKDTree
from trimesh.registration import nricp_amberg

from vermilion.config.multiview import ImageConfig, MultiviewConfig
from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import read_cameras
from vermilion.geometry.closest_points import Surface
from vermilion.geometry.mesh import Mesh, triangle_normals
from vermilion.imaging.frames import open_frames
from vermilion.multiview.cloud import fuse, near_mesh, screened_poisson
from vermilion.multiview.files import read_neutral, read_views
from vermilion.multiview.neutral import stereo_cloud
from vermilion.multiview.nonrigid import register_to_cloud
from vermilion.multiview.solver import ThinPlate
from vermilion.multiview.stereo import StereoSettings
from vermilion.multiview.take import ImageSettings, MultiviewImages
from vermilion.multiview.template_fit import deform_to_landmarks, fit_template
from vermilion.multiview.triangulate import triangulate_landmarks


def main() -> None:
    results, subject, take, capture, truth_folder = sys.argv[1:6]
    cv2.setNumThreads(1)
    folder = Path(results) / "takes" / subject / take
    model = FaceModel.load(Path(results) / "face" / "template.npz")
    config = MultiviewConfig()
    settings, stereo = config.neutral, StereoSettings(**config.stereo.model_dump())
    cameras = read_cameras(folder / "cameras")
    images = ImageSettings(**ImageConfig().model_dump())
    frame = MultiviewImages(open_frames(capture, subject, take), cameras, images).load(0)
    names, points, confidence = read_views(folder / "landmarks/views_neutral.npz", frame.views)
    landmarks = triangulate_landmarks(
        cameras, names, points, confidence, min_confidence=settings.min_confidence,
        max_distance_mm=settings.landmark_distance_mm,
    )  # fmt: skip
    fitted = fit_template(model, landmarks, identity_sigma_mm=settings.landmark_sigma_mm)
    start = deform_to_landmarks(
        fitted, ThinPlate.of(fitted, model.triangles), model.landmarks, landmarks,
        length_mm=settings.landmark_length_mm, sigma_mm=settings.landmark_sigma_mm,
    )  # fmt: skip
    skin = ~(model.regions["mouth_inner"] | model.regions["eyes"])
    target = np.nanmean(landmarks.points_mm[landmarks.valid], axis=0)
    near = near_mesh(
        stereo_cloud(frame, target, stereo), Mesh(start, model.triangles), settings.first_gate_mm,
        skin, 0.2,
    )  # fmt: skip
    cloud = fuse(near, stereo.spacing_mm)
    surface = screened_poisson(cloud, settings.poisson_depth, 2 * stereo.spacing_mm)

    found, seconds = {"start": start}, {"start": 0.0}
    clock = time.perf_counter()
    anneal = np.linspace(0, 1, settings.rounds)
    found["ours"] = register_to_cloud(
        start, model.triangles, cloud, skin,
        lengths_mm=settings.first_length_mm ** (1 - anneal) * settings.last_length_mm**anneal,
        gates_mm=settings.first_gate_mm ** (1 - anneal) * settings.last_gate_mm**anneal,
        spacing_mm=stereo.spacing_mm,
    )  # fmt: skip
    seconds["ours"] = time.perf_counter() - clock
    source = trimesh.Trimesh(start, model.triangles, process=False)
    targets = {
        "nricp_amberg, points": trimesh.PointCloud(cloud.points_mm),
        "nricp_amberg, Poisson surface": trimesh.Trimesh(
            surface.vertices_mm, surface.triangles, process=False
        ),
    }
    for name, geometry in targets.items():
        clock = time.perf_counter()
        moved = nricp_amberg(
            source, geometry, source_landmarks=model.landmarks[landmarks.valid],
            target_positions=landmarks.points_mm[landmarks.valid], use_faces=False,
        )  # fmt: skip
        found[name], seconds[name] = np.asarray(moved), time.perf_counter() - clock
    found["ours and photo-consistency"] = read_neutral(
        folder / "multiview/neutral.npz", model.n_vertices
    )

    truth = Surface(
        np.load(Path(truth_folder) / "vertices_mm.npy", mmap_mode="r")[0],
        np.load(Path(truth_folder) / "triangles.npy"),
    )
    points_tree = cKDTree(cloud.points_mm)
    used = skin & (points_tree.query(found["ours"])[0] < 3.0)
    before = triangle_normals(start, model.triangles)
    shown = used[model.triangles].all(axis=1)
    print("method\ttruth median mm\ttruth p95 mm\tcloud median mm\tturned over %\tseconds")
    for name, vertices in found.items():
        distance = truth.closest(vertices[used]).distance_mm
        _, nearest = points_tree.query(vertices[used])
        offset = vertices[used] - cloud.points_mm[nearest]
        to_cloud = np.abs((offset * cloud.normals[nearest]).sum(axis=1))
        turned = (triangle_normals(vertices, model.triangles) * before).sum(axis=1) < 0
        figures = (np.median(distance), np.percentile(distance, 95), np.median(to_cloud))
        spent = f"{seconds[name]:.1f}" if name in seconds else ""
        share = f"{100 * turned[shown].mean():.2f}"
        print(name, *(f"{value:.3f}" for value in figures), share, spent, sep="\t")


if __name__ == "__main__":
    main()
