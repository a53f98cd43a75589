"""Renders of the report: surface stretch, cropped images, meshes with holes."""

from __future__ import annotations

import numpy as np

from tests.unit.evaluation_face import sheet_face
from vermilion.report.mesh_sheets import (
    clay_columns,
    crop,
    error_columns,
    render_sheet,
    stretch_columns,
    surface_stretch,
)


def test_stretch_of_a_surface_that_grows_and_turns():
    face = sheet_face()
    angle = 0.4
    turn = np.array(
        [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
    )
    meshes = np.stack([face.neutral_mm @ turn.T, 1.2 * face.neutral_mm])
    stretch = surface_stretch(meshes, face.neutral_mm, face.triangles)
    np.testing.assert_allclose(stretch[0], 0.0, atol=1e-9)
    np.testing.assert_allclose(stretch[1], 0.2, atol=1e-9)


def test_unknown_vertices_do_not_spread():
    face = sheet_face()
    mesh = face.neutral_mm.copy()
    mesh[0] = np.nan
    stretch = surface_stretch(mesh[None], face.neutral_mm, face.triangles)[0]
    assert np.isnan(stretch).sum() <= 1
    np.testing.assert_allclose(stretch[np.isfinite(stretch)], 0.0, atol=1e-9)


def test_a_sheet_has_a_row_a_view_and_leaves_holes_white():
    face = sheet_face()
    mesh = face.neutral_mm[None].repeat(2, axis=0)
    mesh[0, :200] = np.nan
    lips = face.regions["vermilion_upper"]
    columns = clay_columns({"base": mesh}, face.triangles, lips)
    columns += stretch_columns({"base": mesh}, {"base": face.neutral_mm}, face.triangles)
    columns += error_columns(
        {"base": mesh}, {"base": np.zeros(mesh.shape[:2])}, face.triangles, 5.0
    )
    centre = np.zeros((2, 3))
    image = np.full((40, 40, 3), 7, np.uint8)
    found = render_sheet(columns, [3, 9], centre, 150.0, 40, [image, image])
    assert found.shape == (4 * 40, 4 * 40, 3)
    assert (found[:40, :40] == 7).all()
    whole, holed = (found[rows, 40:80] < 250 for rows in (slice(80, 120), slice(0, 40)))
    assert 0 < holed.sum() < whole.sum()


def test_a_crop_is_centred_and_white_outside():
    image = np.zeros((100, 100, 3), np.uint8)
    image[48:52, 18:22] = (0, 200, 0)
    found = crop(image, np.array([20.0, 50.0]), 80.0, 160)
    assert found.shape == (160, 160, 3)
    green = np.argwhere(found[..., 1] > 100)
    green = green[(found[green[:, 0], green[:, 1], 0] < 100)]
    np.testing.assert_allclose(green.mean(axis=0), 80.0, atol=2.0)
    assert (found[:, :30] == 255).all()
