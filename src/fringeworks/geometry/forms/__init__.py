"""Forms fitted by orthogonal least squares: planes, spheres, cylinders."""

from fringeworks.geometry.forms.cylinder import CylinderFit, fit_cylinder
from fringeworks.geometry.forms.plane import PlaneFit, fit_plane
from fringeworks.geometry.forms.sphere import SphereFit, fit_sphere

__all__ = ["CylinderFit", "PlaneFit", "SphereFit", "fit_cylinder", "fit_plane", "fit_sphere"]
