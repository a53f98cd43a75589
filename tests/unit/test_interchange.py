"""Files of other programs: what is exported and read again as another tracker's is the same mesh."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.unit.exported import animated_head
from vermilion.export.alembic import alembic_is_installed, write_alembic
from vermilion.export.gltf import write_gltf
from vermilion.export.objs import write_objs, write_plys
from vermilion.export.shape_basis import shape_basis
from vermilion.export.usd import write_usd
from vermilion.export.usd_shapes import write_usd_shapes
from vermilion.external.read import read_tracked
from vermilion.geometry.polygons import Polygons

EXACT_MM = 1e-4
ALEMBIC = pytest.param(
    "abc",
    marks=pytest.mark.skipif(not alembic_is_installed(), reason="package alembic3d is missing"),
)


def write(kind, folder, animation):
    """Write one format; its file or folder."""
    basis = shape_basis(animation, 1e-6) if kind in ("shapes", "gltf") else None
    path = {
        "usd": folder / "a.usdc", "shapes": folder / "shapes.usdc", "gltf": folder / "a.glb",
        "obj": folder / "obj", "ply": folder / "ply", "abc": folder / "a.abc",
        "npz": folder / "a.npz",
    }[kind]  # fmt: skip
    if kind == "usd":
        write_usd(path, animation)
    elif kind == "shapes":
        write_usd_shapes(path, animation, basis)
    elif kind == "gltf":
        write_gltf(path, animation, basis)
    elif kind == "npz":
        np.savez(
            path, vertices_mm=animation.vertices_mm, triangles=animation.polygons.triangles,
            frames=animation.frames,
        )  # fmt: skip
    else:
        {"obj": write_objs, "ply": write_plys, "abc": write_alembic}[kind](path, animation)
    return path


@pytest.mark.parametrize("kind", ["usd", "shapes", "gltf", "obj", "ply", "npz", ALEMBIC])
def test_what_is_exported_reads_as_the_same_mesh(tmp_path, kind):
    animation = animated_head()
    path = write(kind, tmp_path, animation)
    frames = [10, 12, 15]
    back = read_tracked(path, frames, fps=25.0)
    expected = animation.vertices_mm[[0, 2, 4]]
    assert np.abs(back.vertices_mm - expected).max() < EXACT_MM
    if kind in ("gltf", "npz"):  # which have triangles alone
        assert np.array_equal(back.triangles, animation.polygons.triangles)
    else:
        assert np.array_equal(back.polygons.counts, animation.polygons.counts)
        assert np.array_equal(back.polygons.corners, animation.polygons.corners)


@pytest.mark.parametrize("kind", ["usd", "shapes", "obj", "ply"])
@pytest.mark.parametrize("unit_mm", [10.0, 1000.0])
def test_another_unit_reads_as_the_same_mesh(tmp_path, kind, unit_mm):
    animation = replace(animated_head(), unit_mm=unit_mm)
    back = read_tracked(write(kind, tmp_path, animation), [10, 15])
    assert back.unit_mm == pytest.approx(unit_mm)
    assert np.abs(back.vertices_mm - animation.vertices_mm[[0, 4]]).max() < 2 * EXACT_MM
    guessed = any(sentence.startswith("unit guessed") for sentence in back.understood)
    assert guessed == (kind in ("obj", "ply"))


@pytest.mark.parametrize("kind", ["usd", "shapes", "gltf", "obj", "ply", ALEMBIC])
def test_a_frame_without_a_mesh_costs_itself_alone(tmp_path, kind):
    animation = animated_head(np.arange(10, 16))
    broken = animation.vertices_mm.copy()
    broken[2] = np.nan
    path = write(kind, tmp_path, replace(animation, vertices_mm=broken))
    back = read_tracked(path, range(10, 16), fps=25.0)
    assert np.abs(back.vertices_mm[[0, 1, 3, 4, 5]] - broken[[0, 1, 3, 4, 5]]).max() < EXACT_MM
    if kind == "abc":  # which has a sample at every step
        assert np.array_equal(back.vertices_mm[2], back.vertices_mm[1])
    else:
        assert list(back.lost) == [12]
        assert np.isnan(back.vertices_mm[2]).all()


def test_blend_shapes_keep_the_tolerance_and_their_weights_lie_in_0_to_1():
    animation = animated_head(np.arange(40))
    for tolerance in (0.2, 0.02):
        basis = shape_basis(animation, tolerance)
        worst = 0.0
        for index, row in enumerate(basis.rows):
            back = animation.head.to_world(row, basis.vertices_mm(index))
            worst = max(worst, np.linalg.norm(back - animation.vertices_mm[row], axis=1).max())
        assert worst < tolerance + 1e-3
        assert worst == pytest.approx(basis.error_mm, abs=1e-3)
        assert basis.shapes.weights.min() >= 0.0
        assert basis.shapes.weights.max() <= 1.0 + 1e-9
        assert basis.shapes.names[:2] == ("jawOpen", "mouthSmile_L")
        assert np.array_equal(basis.shapes.weights[:, :2], animation.shapes.weights)
    assert len(basis.shapes.names) > 10


def test_a_take_that_is_its_blend_shapes_needs_no_correctives():
    animation = animated_head()
    shapes = animation.shapes
    local = animation.neutral_mm + np.tensordot(shapes.weights, shapes.shapes_mm, axes=1)
    world = np.stack([animation.head.to_world(k, mesh) for k, mesh in enumerate(local)])
    basis = shape_basis(replace(animation, vertices_mm=world), 0.02)
    assert basis.shapes.names == ("jawOpen", "mouthSmile_L")


def test_quads_are_found_again_in_the_triangles_that_they_were_split_into():
    quads = np.array([[0, 1, 2, 3], [3, 2, 4, 5], [5, 4, 6, 7]])
    triangles = np.stack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]], axis=1).reshape(-1, 3)
    lone = np.array([[0, 9, 1]])
    polygons = Polygons.with_quads(np.concatenate([triangles, lone]))
    assert polygons.counts.tolist() == [4, 4, 4, 3]
    assert polygons.corners.tolist() == [*quads.ravel(), 0, 9, 1]
    assert np.array_equal(polygons.triangles, np.concatenate([triangles, lone]))


def test_a_pentagon_is_a_fan_of_three_triangles():
    polygons = Polygons(np.array([5, 3]), np.array([0, 1, 2, 3, 4, 4, 3, 5]))
    assert polygons.triangles.tolist() == [[0, 1, 2], [0, 2, 3], [0, 3, 4], [4, 3, 5]]
