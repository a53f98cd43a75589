"""Shading refinement (Mono13 8): known relief under known light is found again."""

import numpy as np
import pytest
from scipy import sparse
from scipy.spatial import Delaunay

from vermilion.detail.relief.combine import combine_positions_and_normals
from vermilion.detail.relief.high_pass import HighPassFilter
from vermilion.detail.relief.light import ClipLight, estimate_light
from vermilion.detail.relief.normal_map import NormalMap
from vermilion.detail.relief.relief import ReliefSettings, solve_relief, value_deviation
from vermilion.detail.relief.skin_observation import SkinObservation
from vermilion.detail.relief.subdivision import loop_subdivision
from vermilion.detail.relief.tilts import average_tilts, tangents, tilted_normals, tilts_of
from vermilion.detail.relief.topology import FineTopology
from vermilion.geometry.mesh import (
    boundary_edges,
    normalised,
    triangle_normals,
    unique_edges,
    vertex_normals,
)
from vermilion.geometry.rotations import rotation_matrix

SIDE = 41
FACING = np.diag([1.0, -1.0, -1.0])  # world (y up, z to the viewer) to camera


def dome():
    """A dome 60 mm wide, all of it skin: its topology and vertices (S, 3)."""
    x, y = (v.ravel() for v in np.meshgrid(*[np.linspace(-30, 30, SIDE)] * 2))
    corner = (np.arange(SIDE - 1)[:, None] * SIDE + np.arange(SIDE - 1)).ravel()
    triangles = np.concatenate(
        [
            np.stack([corner, corner + 1, corner + SIDE], axis=1),
            np.stack([corner + 1, corner + SIDE + 1, corner + SIDE], axis=1),
        ]
    )
    points = np.stack([x, y, -(x**2 + y**2) / 150], axis=1)
    finer = sparse.identity(len(points), format="csr")
    return FineTopology.of_mask(finer, triangles, np.ones(len(points), dtype=bool)), points


def bump(points):
    """0.6 mm high and 10 mm wide, beside the middle."""
    return 0.6 * np.exp(-((points[:, 0] - 5) ** 2 + points[:, 1] ** 2) / (2 * 5.0**2))


def test_subdivision_keeps_a_plane_flat_and_its_border_straight():
    triangles = np.array([[0, 1, 2], [1, 3, 2]])
    square = np.array([[0.0, 0, 1], [1, 0, 1], [0, 1, 1], [1, 1, 1]])
    finer, fine = loop_subdivision(square, triangles, 2, 0.0, np.ones(4, dtype=bool))
    points = finer @ square
    assert len(fine) == 32 and len(points) == 25
    assert points[:, 2] == pytest.approx(1)
    assert np.asarray(finer.sum(axis=1)).ravel() == pytest.approx(1)
    assert (triangle_normals(points, fine)[:, 2] > 0.99).all()


def test_large_triangles_alone_are_divided_and_no_gap_opens():
    dense, coarse = (
        np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
        for axis in (np.arange(0, 30, 2.5), np.arange(0, 61, 10.0))
    )
    corners = np.concatenate([dense, coarse[coarse.max(axis=1) >= 30]])
    triangles = Delaunay(corners).simplices.astype(np.int32)
    points = np.column_stack([corners, np.ones(len(corners))])
    wanted = np.ones(len(points), dtype=bool)
    finer, fine = loop_subdivision(points, triangles, 8, 4.0, wanted)
    moved = finer @ points
    edges = unique_edges(fine)
    assert np.linalg.norm(moved[edges[:, 0]] - moved[edges[:, 1]], axis=1).max() < 4.2
    assert moved[:, 2] == pytest.approx(1)
    assert (triangle_normals(moved, fine)[:, 2] > 0.99).all()
    assert len(fine) < 0.7 * 4**2 * len(triangles)
    assert len(moved) - len(edges) + len(fine) == 1  # a disc: each gap would be one less
    assert (np.bincount(boundary_edges(fine).ravel())[np.unique(boundary_edges(fine))] == 2).all()
    assert len(loop_subdivision(points, triangles, 2, 0.0, wanted)[1]) == 4**2 * len(triangles)
    wanted[:] = False
    assert (loop_subdivision(points, triangles, 8, 4.0, wanted)[1] == triangles).all()


def clip(topology, side=0.6, noise=0.0):
    """White skin under a light from one side; its values are told to have so much noise."""
    light = np.zeros((9, 3))
    light[0], light[2], light[3], light[1] = 0.8, -0.5, side, -0.4
    n, flat = len(topology.skin), np.zeros(len(topology.skin_ids))
    grain = np.full(n, float(noise))
    return ClipLight(light, np.full((n, 3), 0.35), np.ones(n), grain, np.arange(10), flat)


def degrees_apart(one, two):
    return np.degrees(np.arccos(np.clip((one * two).sum(axis=1), -1, 1)))


@pytest.mark.parametrize(("side", "noise", "left"), [(0.6, 0, 0.4), (-0.6, 0, 0.4), (0.6, 1, 0.6)])
def test_known_bump_under_known_light_is_recovered(side, noise, left):
    topology, points = dome()
    light = clip(topology, side, noise)
    normals = vertex_normals(points, topology.skin)
    true = bump(points)
    shown = triangle_normals(points + true[:, None] * normals, topology.skin) @ FACING.T
    n = len(topology.skin)
    grain = noise * np.random.default_rng(0).normal(size=(n, 1))
    smooth = triangle_normals(points, topology.skin) @ FACING.T
    observed = SkinObservation(light.values(shown) + grain, np.ones(n), smooth)
    settings = ReliefSettings(detail_mm=20.0)
    found = solve_relief(points, FACING, observed, light, topology, settings)
    near = np.hypot(points[:, 0] - 5, points[:, 1]) < 12
    wanted = vertex_normals(points + true[:, None] * normals, topology.skin)
    after = vertex_normals(points + found[:, None] * normals, topology.skin)
    before_deg = degrees_apart(normals, wanted)[near].mean()
    assert before_deg > 2.5
    assert degrees_apart(after, wanted)[near].mean() < left * before_deg
    assert np.corrcoef(found[near], true[near])[0, 1] > 0.9


def test_noise_of_a_display_value_is_no_relief():
    topology, points = dome()
    light = clip(topology, noise=1)
    normals, n = vertex_normals(points, topology.skin), len(topology.skin)
    smooth = triangle_normals(points, topology.skin) @ FACING.T
    grain = np.random.default_rng(0).normal(size=(n, 1))
    observed = SkinObservation(light.values(smooth) + grain, np.ones(n), smooth)
    found = solve_relief(points, FACING, observed, light, topology, ReliefSettings())
    after = vertex_normals(points + found[:, None] * normals, topology.skin)
    assert degrees_apart(after, normals).mean() < 0.55


@pytest.mark.parametrize("trust", [0.0, 1.0])
def test_nothing_seen_and_nothing_different_move_nothing(trust):
    topology, points = dome()
    light, n = clip(topology), len(topology.skin)
    smooth = triangle_normals(points, topology.skin) @ FACING.T
    observed = SkinObservation(light.values(smooth), np.full(n, trust), smooth)
    found = solve_relief(points, FACING, observed, light, topology, ReliefSettings())
    assert np.abs(found).max() < 1e-9


def test_border_of_the_skin_stays():
    topology, points = dome()
    light, n = clip(topology), len(topology.skin)
    smooth = triangle_normals(points, topology.skin) @ FACING.T
    waves = 20 * np.sin(points[topology.skin].mean(axis=1)[:, :1])
    observed = SkinObservation(light.values(smooth) + waves, np.ones(n), smooth)
    found = solve_relief(points, FACING, observed, light, topology, ReliefSettings())
    assert np.abs(found[topology.border]).max() < 1e-4 < np.abs(found).max()


def test_edge_of_paint_is_trusted_less_the_worse_its_place_is_known():
    topology, points = dome()
    light, n = clip(topology), len(topology.skin)
    centres = points[topology.skin].mean(axis=1)
    light.albedo[centres[:, 0] > 0] = 0.1
    smooth = triangle_normals(points, topology.skin) @ FACING.T
    observed = SkinObservation(light.values(smooth), np.ones(n), smooth)
    edge = np.abs(centres[:, 0]) < 1
    for misplaced_mm, most in ((0.0, 1.01), (0.5, 100)):
        settings = ReliefSettings(misplaced_mm=misplaced_mm)
        sigma = value_deviation(light, observed, topology, centres, settings)
        assert sigma[~edge & (np.abs(centres[:, 0]) > 4)].max() < 3
        assert (sigma[edge].max() > 5) == (misplaced_mm > 0) and sigma.max() < most


def test_noise_of_a_clip_is_measured_and_its_light_found():
    topology, points = dome()
    true, n = clip(topology), len(topology.skin)
    rng, observations = np.random.default_rng(2), []
    for _ in range(10):
        turn = rotation_matrix(rng.normal(0, 0.05, 3))
        normals = triangle_normals(points @ turn.T, topology.skin) @ FACING.T
        values = true.values(normals) + 2.0 * rng.normal(size=(n, 1))
        observations.append(SkinObservation(values, np.ones(n), normals))
    centres = points[topology.skin].mean(axis=1)
    found = estimate_light(range(10), observations, topology, centres, 8.0)
    inner = (np.abs(centres[:, :2]) < 25).all(axis=1)
    assert np.median(found.noise[inner]) == pytest.approx(2.0, abs=0.4)
    left = (found.values(normals) - true.values(normals)).mean(axis=1)
    assert np.abs(left[inner]).mean() < 1.0


def test_normal_map_is_flat_without_relief_and_leans_with_it():
    topology, points = dome()
    uv = (points[:, :2] + 30) / 60
    maps = NormalMap(topology, uv, 64)
    assert np.abs(maps.draw(points, points) - [0.5, 0.5, 1.0]).max() < 1e-4
    slope = points + np.outer(0.1 * points[:, 0], [0, 0, 1.0])  # rises along u: leans back
    drawn = maps.draw(points, slope)[16:48, 16:48]
    assert drawn[..., 0].mean() == pytest.approx(0.5 - 0.5 * 0.1, abs=0.01)
    assert drawn[..., 1].mean() == pytest.approx(0.5, abs=0.01)
    rows = points + np.outer(0.1 * points[:, 1], [0, 0, 1.0])
    assert maps.draw(points, rows)[16:48, 16:48, 1].mean() < 0.47  # green is up


def test_displacement_map_is_the_height_of_the_relief():
    topology, points = dome()
    uv = (points[:, :2] + 30) / 60
    maps = NormalMap(topology, uv, 64)
    height = bump(points)
    raised = points + height[:, None] * vertex_normals(points, topology.triangles)
    drawn = maps.draw_displacement(points, raised)
    middle = (np.arange(64) + 0.5) / 64 * 60 - 30
    at = np.column_stack([part.ravel() for part in np.meshgrid(middle, -middle)])
    wanted = bump(np.column_stack([at, np.zeros(len(at))])).reshape(64, 64)
    assert np.abs(drawn - wanted)[8:56, 8:56].max() < 0.05 * height.max()
    assert np.abs(maps.draw_displacement(points, points)).max() < 1e-6


def test_normals_of_a_known_bump_give_the_bump():
    topology, points = dome()
    normals = vertex_normals(points, topology.skin)
    true = bump(points)
    wanted = vertex_normals(points + true[:, None] * normals, topology.skin)
    found = combine_positions_and_normals(points, normals, wanted, topology, 0.02)
    assert np.abs(found - true).max() < 0.06
    assert (
        np.abs(combine_positions_and_normals(points, normals, normals, topology, 0.02)).max() < 1e-9
    )


def test_tilts_return_the_normals_whatever_the_pose():
    topology, points = dome()
    normals = vertex_normals(points, topology.skin)
    fine = normalised(normals + np.random.default_rng(1).normal(0, 0.1, normals.shape))
    tangent = tangents(points, normals, topology)
    tilts = tilts_of(normals, tangent, fine)
    assert tilted_normals(normals, tangent, tilts) == pytest.approx(fine)
    turn = rotation_matrix(np.array([0.2, -0.5, 0.1]))
    turned = tangents(points @ turn.T, normals @ turn.T, topology)
    assert tilts_of(normals @ turn.T, turned, fine @ turn.T) == pytest.approx(tilts)


def test_average_is_symmetric_and_cut_at_the_ends_of_the_take():
    tilts = {f: np.array([[float(f), 2.0 * f, 1.0]]) for f in range(9)}
    for frame in range(9):  # an even motion is not delayed
        assert average_tilts(tilts.__getitem__, frame, (0, 8), 5)[0] == pytest.approx(
            [frame, 2 * frame]
        )
    tilts[4][:, 2] = 0  # what is not seen is taken from the neighbours
    assert average_tilts(tilts.__getitem__, 4, (0, 8), 5)[0] == pytest.approx([4, 8])


def test_detail_is_what_changes_over_a_short_range():
    topology, points = dome()
    centres = points[topology.skin].mean(axis=1)
    detail = HighPassFilter(topology.pairs, centres, np.ones(len(centres)), 4.0)
    inner = (np.abs(centres[:, :2]) < 20).all(axis=1)
    wave, slow = (np.sin(centres[:, 0] * 2 * np.pi / length) for length in (4, 120))
    assert np.abs(detail(wave) - wave)[inner].max() < 0.2
    assert np.abs(detail(slow))[inner].max() < 0.15
