"""Forms fitted by orthogonal least squares: planes, spheres, cylinders, cones."""

from fringeworks.geometry.forms.cone import ConeFit, fit_cone
from fringeworks.geometry.forms.cylinder import CylinderFit, fit_cylinder
from fringeworks.geometry.forms.plane import PlaneFit, fit_plane
from fringeworks.geometry.forms.sphere import SphereFit, fit_sphere

__all__ = [
    "ConeFit",
    "CylinderFit",
    "PlaneFit",
    "SphereFit",
    "fit_cone",
    "fit_cylinder",
    "fit_plane",
    "fit_sphere",
]
