"""The tracker's model of one person, from a scan (Mono13 4, Lips16 3.2)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vermilion.faces.model import FaceModel
from vermilion.geometry.closest_points import Surface
from vermilion.geometry.mesh import Mesh, boundary_edges, triangle_areas, vertex_areas
from vermilion.geometry.registration import LandmarkTargets, Schedule, register
from vermilion.geometry.surface_points import SurfacePoints
from vermilion.scan.fit import ScanFit, fit_landmarks, standard_unit
from vermilion.scan.landmarks import LEAST_GIVEN, ScanLandmarks
from vermilion.scan.transfer import DeformationTransfer
from vermilion.storage.errors import InputError
from vermilion.storage.quality import QualityRow

#: Wavelengths under which differences are smoothed away; one dense search each.
_WAVELENGTHS_MM = (80.0, 50.0, 30.0, 20.0, 12.0, 8.0, 5.0, 4.0, 4.0)
#: Of the dense searches: reach of the first, the share to which it narrows, angle of the normals.
_SEARCH_MM, _NARROWEST, _MAX_ANGLE_DEG = 20.0, 0.25, 60.0
#: Share of the face that a scan must cover, and what a scan is warned of: distance to it, share met.
_LEAST_COVERED, _FAR_MM, _LITTLE_MET = 0.5, 0.5, 0.8


@dataclass(frozen=True)
class PersonalModel:
    """What came of a scan.

    Attributes:
        model: of the tracker's topology: the person's neutral and expressions, no identities.
        fit: the scan's head frame, and the generic model's coefficients.
        scan: the scan in the head frame, mm.
        registered: the model laid over it, with the face of the scan.
        met: (V,) bool, vertices that met the scan.
        distance_mm: (V,) from the registered vertices to the scan.
    """

    model: FaceModel
    fit: ScanFit
    scan: Mesh
    registered: Mesh
    met: np.ndarray
    distance_mm: np.ndarray

    def figures(self) -> dict[str, float]:
        """Distances at the triangles' centres over the skin of the face, weighted by area."""
        triangles = self.model.triangles
        skin = searching_vertices(self.model)[triangles].all(axis=1)
        vertices = self.registered.vertices_mm
        area = triangle_areas(vertices, triangles[skin])
        centres = vertices[triangles[skin]].mean(axis=1)
        away = _distance_to(self.scan, centres)
        order = np.argsort(away)
        share = np.cumsum(area[order]) / area.sum()
        return {
            "unit_mm": self.fit.head_from_scan.scale,
            "distance_mean_mm": float(area @ away / area.sum()),
            "distance_p95_mm": float(away[order][np.searchsorted(share, 0.95)]),
            "met_share": float(area @ self.met[triangles[skin]].all(axis=1) / area.sum()),
        }

    def quality(self) -> QualityRow:
        """A row with a reason where the figures look wrong."""
        figures, reasons = self.figures(), []
        if figures["distance_mean_mm"] > _FAR_MM:
            reasons.append(f"the model lies {figures['distance_mean_mm']:.2f} mm from the scan")
        if figures["met_share"] < _LITTLE_MET:
            reasons.append(f"the scan covers only {figures['met_share']:.0%} of the face")
        return QualityRow(0, not reasons, "; ".join(reasons), figures)


def personal_model(
    generic: FaceModel,
    scan: Mesh,
    landmarks: ScanLandmarks,
    *,
    unit_mm: float | None = None,
    least_opening: float = 0.0,
    closed_eyes: bool = False,
    finest_mm: float = 4.0,
    subject: str | None = None,
) -> PersonalModel:
    """Fit, register, and transfer all expressions.

    The scan need not be neutral: the model is posed as the landmarks say before it is laid over the
    scan, and the neutral is transferred from that pose as the expressions are.

    Args:
        generic: the tracker's model.
        scan: in its own frame and unit.
        landmarks: on it.
        unit_mm: length of the scan's unit; None: a standard one, or from the model (`standard_unit`).
        least_opening: lower bound of the weight of jawOpen; the tracker's neutral has parted lips,
            so that closed ones are a weight below zero.
        closed_eyes: whether the scan's lids are shut.
        finest_mm: shortest wavelength of the registration.

    Raises:
        InputError: too few landmarks; a scan that covers less than half of the face.
    """
    if landmarks.known.sum() < LEAST_GIVEN:
        raise InputError(
            f"{int(landmarks.known.sum())} landmarks on the scan",
            f"at least {LEAST_GIVEN}",
            "The scan may have holes where the face is; give landmarks by hand "
            "(tracking.scan_landmarks).",
            subject=subject,
        )
    bounds = {"jawOpen": (least_opening, 1.0)}
    fit = fit_landmarks(generic, landmarks, unit_mm, bounds, closed_eyes)
    known_unit = standard_unit(fit.head_from_scan.scale) if unit_mm is None else None
    if known_unit is not None:
        fit = fit_landmarks(generic, landmarks, known_unit, bounds, closed_eyes)
    in_head = scan.with_vertices(fit.head_from_scan.apply(scan.vertices_mm))
    registered, met = _registered(generic, fit, in_head, finest_mm)
    area = vertex_areas(generic.vertices(fit.identity, fit.weights), generic.triangles)
    area = area * searching_vertices(generic)
    covered = float(area @ met / area.sum())
    if covered < _LEAST_COVERED:
        raise InputError(
            f"a scan that covers {covered:.0%} of the face",
            "at least half, skin without hair or glasses",
            "Look at the overlay of the landmarks; the scan may be inside out.",
            subject=subject,
        )
    distance = _distance_to(in_head, registered.vertices_mm)
    model = transferred(generic, fit, registered.vertices_mm)
    return PersonalModel(model, fit, in_head, registered, met, distance)


def _registered(
    generic: FaceModel, fit: ScanFit, in_head: Mesh, finest_mm: float
) -> tuple[Mesh, np.ndarray]:
    """The fitted model laid over the scan, and (V,) bool of the vertices that met it."""
    posed = Mesh(generic.vertices(fit.identity, fit.weights), generic.triangles)
    known = np.isfinite(fit.points_mm).all(axis=1)
    points = SurfacePoints.at_vertices(generic.landmarks[known], generic.triangles)
    landmarks = LandmarkTargets(points, fit.points_mm[known], 1.0 / fit.sigma_mm[known] ** 2)
    wavelengths = [w for w in _WAVELENGTHS_MM if w > finest_mm] + [finest_mm] * 2
    schedule = Schedule(wavelengths, _SEARCH_MM, _MAX_ANGLE_DEG, _NARROWEST)
    return register(posed, in_head, landmarks, schedule, searching=searching_vertices(generic))


def _distance_to(scan: Mesh, points_mm: np.ndarray) -> np.ndarray:
    """Distance (N,) mm of points (N, 3) to the surface of a scan in their frame."""
    found = Surface(scan.vertices_mm, scan.triangles).closest(points_mm).distance_mm
    assert found is not None  # a search gives it
    return found


def transferred(generic: FaceModel, fit: ScanFit, registered_mm: np.ndarray) -> FaceModel:
    """The generic model's neutral and expressions carried to a pose, registered_mm (V, 3), head frame."""
    posed = generic.vertices(fit.identity, fit.weights)
    transfer = DeformationTransfer(
        posed, registered_mm, generic.triangles, generic.regions["rigid"]
    )
    poses = np.concatenate([np.zeros((1, generic.n_expressions)), np.eye(generic.n_expressions)])
    carried = transfer.transfer(generic.vertices(fit.identity, poses))
    neutral = carried[0]
    return replace(
        generic,
        neutral_mm=neutral,
        expressions_mm=(carried[1:] - neutral).astype(np.float32),
        identities_mm=np.zeros((0, generic.n_vertices, 3), dtype=np.float32),
    )


def searching_vertices(model: FaceModel) -> np.ndarray:
    """(V,) bool: the skin, without the inside of the mouth and the model's borders."""
    searching = model.regions["face"] & ~model.regions["mouth_inner"]
    searching &= ~model.regions["eyes"] & ~model.regions["teeth"]
    searching[boundary_edges(model.triangles)] = False
    return searching
