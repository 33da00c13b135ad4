"""The four forms by name, and any of them as a surface that points can be held against."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.geometry.forms.cone import ConeFit, apex_of, fit_cone, opened
from fringeworks.geometry.forms.conical import Conical, fit_along
from fringeworks.geometry.forms.curved import SMALLEST, Curved, fit_algebraic, tangents
from fringeworks.geometry.forms.cylinder import CylinderFit, fit_cylinder
from fringeworks.geometry.forms.plane import PlaneFit, fit_plane
from fringeworks.geometry.forms.sphere import SphereFit, fit_sphere

Array = NDArray[np.float64]

FormName: TypeAlias = Literal["plane", "sphere", "cylinder", "cone"]
FormFit: TypeAlias = PlaneFit | SphereFit | CylinderFit | ConeFit

FITS: Mapping[FormName, Callable[..., FormFit]] = MappingProxyType(
    {"plane": fit_plane, "sphere": fit_sphere, "cylinder": fit_cylinder, "cone": fit_cone}
)
"""From the simplest on: a form contains, at its limits, those before it."""


@dataclass(frozen=True, slots=True, eq=False)
class Shape:
    """A form without points.

    Attributes
    ----------
    point
        ``(3,)`` mm: of the plane, of the axis, the centre, or the apex.
    axis
        ``(3,)`` unit: the normal, or the axis; of no meaning for a sphere.
    size
        Radius, mm; of a cone the half angle, rad; of no meaning for a plane.
    """

    name: FormName
    point: Array
    axis: Array
    size: float

    def distances(self, points: Array) -> Array:
        """Signed distances ``(n,)`` of points ``(n, 3)``, mm."""
        away = points - self.point
        if self.name == "plane":
            return np.asarray(away @ self.axis)
        if self.name == "sphere":
            return np.asarray(np.linalg.norm(away, axis=1) - self.size)
        along = away @ self.axis
        across = np.linalg.norm(away - along[:, None] * self.axis, axis=1)
        if self.name == "cylinder":
            return np.asarray(across - self.size)
        return np.asarray(across * np.cos(self.size) - along * np.sin(self.size))

    def normals(self, points: Array) -> Array:
        """``(n, 3)`` unit normals next to points ``(n, 3)``, outwards."""
        away = points - self.point
        if self.name == "plane":
            return np.broadcast_to(self.axis, points.shape)
        if self.name != "sphere":
            away = away - (away @ self.axis)[:, None] * self.axis
        outwards = away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), SMALLEST)
        if self.name != "cone":
            return np.asarray(outwards)
        return np.asarray(outwards * np.cos(self.size) - self.axis * np.sin(self.size))


def name_of(fit: FormFit) -> FormName:
    """What was fitted."""
    match fit:
        case PlaneFit():
            return "plane"
        case SphereFit():
            return "sphere"
        case CylinderFit():
            return "cylinder"
        case ConeFit():
            return "cone"


def shape_of(fit: FormFit) -> Shape:
    """The surface of a fit."""
    match fit:
        case PlaneFit():
            return Shape("plane", fit.normal * fit.offset_mm, fit.normal, 0.0)
        case SphereFit():
            return Shape("sphere", fit.centre_mm, np.array([0.0, 0.0, 1.0]), fit.radius_mm)
        case CylinderFit():
            return Shape("cylinder", fit.axis_point_mm, fit.axis_direction, fit.radius_mm)
        case ConeFit():
            half = float(np.deg2rad(fit.half_angle_deg))
            return Shape("cone", fit.apex_mm, fit.axis_direction, half)


def guess_shape(name: FormName, points: Array, normals: Array) -> Shape | None:
    """A form through a patch of points ``(n, 3)`` with unit normals ``(n, 3)``, in closed form.

    Planes by principal components, spheres by Taubin's fit; the axis of a cylinder or a cone is
    the direction in which the normals differ least, and Taubin's fit across it gives the rest.
    None where the patch has no such form, as a radius where it is flat.
    """
    middle = points.mean(axis=0)
    if name == "plane":
        _, axes = np.linalg.eigh(np.cov(points, rowvar=False))
        return Shape("plane", middle, axes[:, 0], 0.0)
    if name == "sphere":
        return _guess_sphere(points - middle, middle)
    straight = np.cov(normals, rowvar=False) if name == "cone" else normals.T @ normals
    return _guess_about(name, points - middle, middle, np.linalg.eigh(straight)[1][:, 0])


def _guess_sphere(centred: Array, middle: Array) -> Shape | None:
    curvature, foot, normal = fit_algebraic(centred)
    if abs(curvature) < SMALLEST:
        return None
    return Shape("sphere", middle + foot + normal / curvature, normal, float(1 / abs(curvature)))


def _guess_about(name: FormName, centred: Array, middle: Array, axis: Array) -> Shape | None:
    basis = np.stack([*tangents(axis), axis])
    (curvature,), (rise,), (normal,), (opening,) = fit_along((centred @ basis.T)[None])
    if abs(curvature) < SMALLEST:
        return None
    toward = normal @ basis[:2]
    if name == "cylinder":
        point = middle + (rise + 1 / curvature) * toward
        return Shape("cylinder", point, axis, float(1 / abs(curvature)))
    sign = np.sign(curvature)  # the frame of a surface has its centre ahead
    frame = np.stack([sign * toward, axis, np.cross(sign * toward, axis)], axis=1)
    base = Curved(middle + rise * toward, frame, abs(float(curvature)), straight=True)
    cone = opened(Conical(base, float(sign * opening)))
    if cone.opening < SMALLEST:
        return None
    return Shape("cone", apex_of(cone), cone.base.frame[:, 1], cone.opening)
