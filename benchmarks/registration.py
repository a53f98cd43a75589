"""Registration of the template to stereo points, against `trimesh.registration.nricp_amberg`.

Template, cameras and landmarks are those of a finished run's multi-view take. Both methods start from
the template as it lies on the triangulated landmarks; both get the same stereo points of the take's
first frame, ours as points, the peer as points and as their Poisson surface (nearest vertices with
normals, its default steps and landmarks). Polishing by photo-consistency is left out; its result is
shown for reference.

Figures over template vertices of the skin that lie within 3 mm of a stereo point: distance to the true
surface (mm), to the stereo points' surface (mm), share of triangles that turned over (normals against
the start's by more than 90 degrees), wall seconds.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from functools import partial

import numpy as np
import trimesh
from scipy.spatial import cKDTree
from trimesh.registration import nricp_amberg

from benchmarks.common import add_run_arguments, print_table, timed
from benchmarks.finished_run import FinishedRun
from vermilion.config.multiview import MultiviewConfig
from vermilion.faces.model import FaceModel
from vermilion.geometry.closest_points import Surface
from vermilion.geometry.mesh import Mesh, triangle_normals
from vermilion.multiview.cloud import fuse, near_mesh, screened_poisson
from vermilion.multiview.files import read_landmark_views
from vermilion.multiview.neutral import stereo_cloud
from vermilion.multiview.nonrigid import register_to_cloud
from vermilion.multiview.solver import ThinPlate
from vermilion.multiview.stereo import Cloud, StereoSettings
from vermilion.multiview.take import ImageSettings, MultiviewImages
from vermilion.multiview.template_fit import deform_to_landmarks, fit_template
from vermilion.multiview.triangulate import Triangulated, triangulate_landmarks


@dataclass(frozen=True)
class Problem:
    """What both methods get: the template, where it starts (V, 3) mm, which vertices are skin (V,),
    the landmarks and the stereo points of the first frame, all in the world frame."""

    model: FaceModel
    start_mm: np.ndarray
    skin: np.ndarray
    landmarks: Triangulated
    cloud: Cloud

    @classmethod
    def of(cls, run: FinishedRun, config: MultiviewConfig) -> Problem:
        """Read and triangulate the take's first frame."""
        model, cameras = run.model("template"), run.cameras()
        settings, stereo = config.neutral, StereoSettings(**config.stereo.model_dump())
        images = ImageSettings(**config.images.model_dump())
        frame = MultiviewImages(run.images(), cameras, images).load(0)
        views = read_landmark_views(run.folder / "landmarks" / "views_neutral.npz", frame.views)
        landmarks = triangulate_landmarks(
            cameras, *views, min_confidence=settings.min_confidence,
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
            stereo_cloud(frame, target, stereo), Mesh(start, model.triangles),
            settings.first_gate_mm, skin, 0.2,
        )  # fmt: skip
        return cls(model, start, skin, landmarks, fuse(near, stereo.spacing_mm))


def ours(problem: Problem, config: MultiviewConfig) -> np.ndarray:
    """Vertices (V, 3) mm registered by the stage."""
    settings, anneal = config.neutral, np.linspace(0, 1, config.neutral.rounds)
    return register_to_cloud(
        problem.start_mm, problem.model.triangles, problem.cloud, problem.skin,
        lengths_mm=settings.first_length_mm ** (1 - anneal) * settings.last_length_mm**anneal,
        gates_mm=settings.first_gate_mm ** (1 - anneal) * settings.last_gate_mm**anneal,
        spacing_mm=config.stereo.spacing_mm,
    )  # fmt: skip


def peer(problem: Problem, target: trimesh.Trimesh | trimesh.PointCloud) -> np.ndarray:
    """Vertices (V, 3) mm registered by trimesh."""
    source = trimesh.Trimesh(problem.start_mm, problem.model.triangles, process=False)
    marked = problem.landmarks.valid
    return np.asarray(
        nricp_amberg(
            source, target, source_landmarks=problem.model.landmarks[marked],
            target_positions=problem.landmarks.points_mm[marked], use_faces=False,
        )
    )  # fmt: skip


def figures(problem: Problem, vertices_mm: np.ndarray, used: np.ndarray, truth: Surface) -> dict:
    """Figures of `vertices_mm` (V, 3) over the vertices `used` (V,)."""
    cloud, triangles = problem.cloud, problem.model.triangles
    distance = truth.closest(vertices_mm[used]).distance_mm
    nearest = cKDTree(cloud.points_mm).query(vertices_mm[used])[1]
    offset = vertices_mm[used] - cloud.points_mm[nearest]
    to_cloud = np.abs((offset * cloud.normals[nearest]).sum(axis=1))
    before = triangle_normals(problem.start_mm, triangles)
    turned = (triangle_normals(vertices_mm, triangles) * before).sum(axis=1) < 0
    return {
        "truth median mm": np.median(distance),
        "truth p95 mm": np.percentile(distance, 95),
        "cloud median mm": np.median(to_cloud),
        "turned over %": 100 * turned[used[triangles].all(axis=1)].mean(),
    }


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What is read."""
    add_run_arguments(parser, "p1/rom")


def run(arguments: argparse.Namespace) -> None:
    """Measure and print."""
    take, config = FinishedRun.of(arguments), MultiviewConfig()
    problem = Problem.of(take, config)
    spacing_mm = config.stereo.spacing_mm
    surface = screened_poisson(problem.cloud, config.neutral.poisson_depth, 2 * spacing_mm)
    points = trimesh.PointCloud(problem.cloud.points_mm)
    poisson = trimesh.Trimesh(surface.vertices_mm, surface.triangles, process=False)
    methods = {
        "ours": partial(ours, problem, config),
        "nricp_amberg, points": partial(peer, problem, points),
        "nricp_amberg, Poisson surface": partial(peer, problem, poisson),
    }
    results = {name: timed(method) for name, method in methods.items()}
    found = {"start": problem.start_mm} | {name: r.result for name, r in results.items()}
    found["ours and photo-consistency"] = take.neutral_mm(problem.model)
    truth = Surface(take.true_mm()[0], take.true_triangles())
    used = problem.skin & (cKDTree(problem.cloud.points_mm).query(found["ours"])[0] < 3.0)
    rows = [
        {"method": name}
        | figures(problem, vertices, used, truth)
        | {"s": results[name].wall_s if name in results else np.nan}
        for name, vertices in found.items()
    ]
    print_table(rows, {"truth median mm": 3, "truth p95 mm": 3, "cloud median mm": 3, "s": 1})
