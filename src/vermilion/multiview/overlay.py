"""Images of what the stage did: mesh over images, clouds, residuals, visibility."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from vermilion.geometry.camera import Camera
from vermilion.imaging.draw import colour_map, draw_mesh, draw_points, resized_to_height, tile
from vermilion.imaging.draw import label as write_label
from vermilion.multiview.neutral import Neutral
from vermilion.multiview.pairs import density
from vermilion.multiview.stereo import Cloud
from vermilion.multiview.take import AccurateFrame
from vermilion.multiview.views import Frame, View

_HEIGHT_PX = 360


def labelled(image: np.ndarray, text: str) -> np.ndarray:
    """An image (h, w, 3) uint8 at the sheet's size with a line of text, (h', w', 3) uint8."""
    high = image.shape[0] > _HEIGHT_PX
    return write_label(resized_to_height(image, _HEIGHT_PX) if high else image, text)


def show(view: View) -> np.ndarray:
    """The image of a view as grey RGB, (h, w, 3) uint8."""
    grey = np.rint(np.clip(view.grey, 0, 1) * 255).astype(np.uint8)
    return np.repeat(grey[..., None], 3, axis=2)


def show_wires(view: View, vertices_mm: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """The image (h, w, 3) uint8 with edges (E, 2) of vertices_mm (V, 3), world, drawn thinly."""
    image = show(view)
    pixels = view.camera.project(vertices_mm)
    ends = pixels[edges]
    ends = ends[np.isfinite(ends).all(axis=(1, 2))]
    fixed = np.rint((ends - 0.5) * 16).astype(np.int32)
    lines = image.copy()
    cv2.polylines(lines, list(fixed), False, (90, 255, 140), 1, cv2.LINE_AA, 4)
    return cv2.addWeighted(lines, 0.6, image, 0.4, 0)


def show_cloud(camera: Camera, cloud: Cloud) -> np.ndarray:
    """The cloud from a camera, shaded by its normals, (h, w, 3) uint8."""
    image = np.zeros((camera.height_px, camera.width_px, 3), dtype=np.uint8)
    if not len(cloud):
        return image
    towards = camera.centre_mm - cloud.points_mm
    depth = np.linalg.norm(towards, axis=1)
    shade = np.abs((cloud.normals * towards).sum(axis=1)) / depth
    value = np.rint(255 * (0.2 + 0.8 * shade)).astype(np.uint8)
    return draw_dots(image, camera, cloud.points_mm, np.repeat(value[:, None], 3, axis=1))


def draw_dots(
    image: np.ndarray, camera: Camera, points_mm: np.ndarray, colours: np.ndarray
) -> np.ndarray:
    """A copy of an image with points as dots of 2 x 2 pixels, the nearest on top.

    Args:
        image: (h, w, 3) uint8.
        camera: of the image.
        points_mm: (N, 3) world, mm.
        colours: (N, 3) uint8.

    Returns:
        (h, w, 3) uint8.
    """
    image = image.copy()
    depth = np.linalg.norm(camera.centre_mm - points_mm, axis=1)
    pixels = camera.project(points_mm)
    inside = camera.in_image(pixels, 1.0)
    order = np.argsort(-depth[inside], kind="stable")
    column, row = np.floor(pixels[inside][order]).astype(int).T
    for down in (0, 1):
        for right in (0, 1):
            y = np.minimum(row + down, camera.height_px - 1)
            x = np.minimum(column + right, camera.width_px - 1)
            image[y, x] = colours[inside][order]
    return image


def pick_cameras(frame: Frame, target_mm: np.ndarray, count: int = 2) -> list[str]:
    """The widest and the closest camera of a frame at target_mm (3,), and further ones between."""
    sharp = {name: round(density(view.camera, target_mm), 1) for name, view in frame.views.items()}
    inward = {
        name: abs(np.dot(view.camera.rotation[2], _mean_axis(frame)))
        for name, view in frame.views.items()
    }
    order = sorted(sharp, key=lambda name: (sharp[name], -inward[name]))
    closest = [name for name in order if sharp[name] == sharp[order[-1]]]
    picks = [order[0], closest[0], closest[-1], order[len(order) // 2]]
    return list(dict.fromkeys(picks))[:count]


def _mean_axis(frame: Frame) -> np.ndarray:
    axis = np.sum([view.camera.rotation[2] for view in frame.views.values()], axis=0)
    return axis / np.linalg.norm(axis)


def neutral_sheet(
    frame: Frame, neutral: Neutral, triangles: np.ndarray, edges: np.ndarray
) -> np.ndarray:
    """Wires, mesh, cloud, Poisson surface and certainty of the neutral in two cameras.

    For a later take of a person also how far its own fit lay from the first take's points.

    Args:
        frame: of the neutral.
        neutral: V vertices.
        triangles, edges: (T, 3), (E, 2) of it.

    Returns:
        (h, w, 3) uint8.
    """
    images = []
    error = np.where(
        neutral.information > 0, 1.0 / np.sqrt(np.maximum(neutral.information, 1e-12)), np.nan
    )
    colours = colour_map(error, 0.0, 0.3)
    for name in pick_cameras(frame, neutral.vertices_mm.mean(axis=0)):
        view = frame.views[name]
        image, camera = show(view), view.camera
        landmarks = camera.project(neutral.landmarks.points_mm)
        surface = neutral.surface
        images += [
            labelled(draw_points(image, landmarks, (255, 80, 80)), f"{name}: landmarks"),
            labelled(show_wires(view, neutral.vertices_mm, edges), "template"),
            labelled(show_cloud(camera, neutral.cloud), "stereo points"),
            labelled(
                draw_mesh(0 * image, camera, surface.vertices_mm, surface.triangles), "Poisson"
            ),
            labelled(draw_mesh(0 * image, camera, neutral.vertices_mm, triangles), "mesh"),
            labelled(
                draw_mesh(0 * image, camera, neutral.vertices_mm, triangles, colours),
                "expected error, 0 to 0.3 mm",
            ),
        ]
        if neutral.first_take:
            moved = colour_map(neutral.moved_mm, 0.0, 5.0)
            text = f"to the points of {neutral.first_take}, 0 to 5 mm"
            mesh = draw_mesh(0 * image, camera, neutral.vertices_mm, triangles, moved)
            images.append(labelled(mesh, text))
    return tile(images, 7 if neutral.first_take else 6)


def frames_sheet(
    shown: Sequence[tuple[Frame, AccurateFrame]], triangles: np.ndarray, edges: np.ndarray
) -> np.ndarray:
    """For some frames of a chunk: wires, mesh, cloud, residual and visibility in two cameras.

    Args:
        shown: the frames and what was found in them.
        triangles, edges: (T, 3), (E, 2) of the mesh.

    Returns:
        (h, w, 3) uint8.
    """
    images = []
    for frame, refined in shown:
        registered = refined.registered
        vertices = registered.vertices_mm
        residual = colour_map(registered.residual_px, 0.0, 1.0)
        seeing = np.where(registered.cameras_seeing > 0, registered.cameras_seeing, np.nan)
        visible = colour_map(seeing.astype(float), 0, 10, "viridis")
        for name in pick_cameras(frame, vertices.mean(axis=0)):
            view = frame.views[name]
            empty, camera = 0 * show(view), view.camera
            images += [
                labelled(show_wires(view, vertices, edges), f"frame {frame.number} {name}"),
                labelled(draw_mesh(empty, camera, vertices, triangles), "mesh"),
                labelled(show_cloud(camera, refined.cloud), "stereo points"),
                labelled(
                    draw_mesh(empty, camera, vertices, triangles, residual),
                    "residual, 0 to 1 px; grey: unseen",
                ),
                labelled(
                    draw_mesh(empty, camera, vertices, triangles, visible),
                    "cameras, 0 to 10; grey: unseen",
                ),
            ]
    if not images:  # no frame of the chunk could be registered
        images = [labelled(np.zeros((60, 480, 3), dtype=np.uint8), "no valid frame to show")]
    return tile(images, 5)
