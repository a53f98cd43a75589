"""Which vertices and triangles are which lip."""

import numpy as np

from tests.heads import small_tracker
from vermilion.faces.lips import lip_sides, lip_sides_by_distance, triangle_sides
from vermilion.geometry.mesh import Mesh, adjacency


def test_the_upper_lip_is_positive_and_the_lower_negative():
    model = small_tracker()
    sides = lip_sides(model)
    assert set(sides.tolist()) == {-1, 0, 1}
    height = model.neutral_mm[:, 1]
    assert height[sides > 0].mean() > height[sides < 0].mean() + 5.0  # mm
    red = model.regions["vermilion_upper"] | model.regions["vermilion_lower"]
    assert ((sides != 0) == red).all()


def test_the_inside_of_a_lip_grows_from_its_red_by_two_rings():
    model = small_tracker()
    red, grown = lip_sides(model), lip_sides(model, with_inside=True)
    new = (grown != 0) & (red == 0)
    assert new.any() and model.regions["mouth_inner"][new].all()
    assert (grown[red != 0] == red[red != 0]).all()
    near = adjacency(model.triangles, model.n_vertices)
    for side in (1, -1):
        reached = red == side
        for _ in range(2):
            reached = reached | (near @ reached > 0)
        assert reached[grown == side].all()


def test_sides_by_distance_cover_the_mouth_but_for_the_corners():
    model = small_tracker()
    mesh = Mesh(model.neutral_mm, model.triangles)
    sides = lip_sides_by_distance(mesh, model.regions)
    red = lip_sides(model)
    one = model.regions["vermilion_upper"] ^ model.regions["vermilion_lower"]
    assert (sides[one] == red[one]).all()
    inside = model.regions["mouth_inner"]
    assert (sides[inside] != 0).mean() > 0.9
    clear = lip_sides_by_distance(mesh, model.regions, corner_mm=4.0)
    assert ((clear == sides) | (clear == 0)).all()
    assert 0 < (clear != 0).sum() < (sides != 0).sum()


def test_a_triangle_takes_the_side_of_most_of_its_corners():
    triangles = np.array([[0, 1, 2], [0, 1, 3], [0, 3, 4], [2, 2, 2]])
    assert triangle_sides(triangles, np.array([1, 1, 0, -1, 0])).tolist() == [1, 1, 0, 0]
