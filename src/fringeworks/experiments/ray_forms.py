"""Planes, balls and a cylinder seen pixel by pixel in closed form: scans without images.

What a rig errs by is told by points where rays meet forms, and takes milliseconds; the twin, which
forms images, tells what light, pixels and decoding add.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.geometry.align import align_points
from fringeworks.geometry.forms import fit_cylinder, fit_plane, fit_sphere
from fringeworks.geometry.lens import pixel_rays, project
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.model import Rig

Array = NDArray[np.float64]

PLANES = (
    (600.0, (0.0, 0.0, 0.0)),
    (660.0, (15.0, -10.0, 0.0)),
    (700.0, (-6.0, 8.0, 0.0)),
    (740.0, (0.0, 20.0, 0.0)),
)
"""All over the view: z on the axis, mm, and rotation vector, degrees; none is a board's."""

CYLINDER_MM, CYLINDER_RADIUS_MM, CYLINDER_HALF_MM = (4.0, 2.0, 700.0), 52.5, 65.0
BALLS_MM, BALL_RADIUS_MM = ((-57.0, 12.0, 672.0), (57.0, -12.0, 702.0)), 20.0
FACING = 0.3
"""Least cosine between a surface's normal and the ray: steeper points no scan has."""

STEP_PX, BALL_STEP_PX = 6, 2


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """Points ``(n, 3)``, mm, and the px ``(n, 2)`` of camera and projector that see them.

    `lit` is the share of the points offered that lie in the projector's image: the others are
    left out.
    """

    points: Array
    camera_px: Array
    projector_px: Array
    lit: float


@dataclass(frozen=True, slots=True, eq=False)
class Forms:
    """What a rig sees of planes, the cylinder and both balls."""

    planes: tuple[Seen, ...]
    cylinder: Seen
    balls: tuple[Seen, ...]

    scale: float

    @classmethod
    def of(cls, rig: Rig, scale: float = 1.0) -> Forms:
        """Of the true rig, its lenses' distortion with it; all lengths of the forms times `scale`.

        So they keep their places in the camera's image, nearer or farther.
        """
        coarse, fine = _rays(rig, STEP_PX), _rays(rig, BALL_STEP_PX)
        return cls(
            tuple(see(rig, scale * meet_plane(coarse, z, turn)) for z, turn in PLANES),
            see(rig, scale * _meet_cylinder(coarse)),
            tuple(see(rig, scale * _meet_ball(fine, np.array(middle))) for middle in BALLS_MM),
            scale,
        )

    @property
    def lit(self) -> float:
        """Least share of any form that the projector lights."""
        return min(seen.lit for seen in (*self.planes, self.cylinder, *self.balls))


@dataclass(frozen=True, slots=True)
class FormErrors:
    """What a scan of `Forms` errs by, mm.

    `planes_rms_mm` is the distance of all planes' points from the true ones after one rigid motion,
    `plane_form_mm` that about each one's own fit; the others are measured less true.
    """

    plane_form_mm: float
    planes_rms_mm: float
    cylinder_radius_mm: float
    ball_radius_mm: float
    ball_distance_mm: float


def judge_scan(
    forms: Forms, scanned: tuple[tuple[Array, ...], Array, tuple[Array, ...]]
) -> FormErrors:
    """Hold scanned points, of planes, cylinder and balls as `Forms` has them, against the truth."""
    (planes, cylinder, balls), scale = scanned, forms.scale
    measured, true = np.concatenate(planes), np.concatenate([seen.points for seen in forms.planes])
    rotation, translation = align_points(measured, true)
    off = measured @ rotation.T + translation - true
    flat = [fit_plane(scan).form_rms_mm for scan in planes]
    found = [fit_sphere(scan) for scan in balls]
    apart = float(np.linalg.norm(found[0].centre_mm - found[1].centre_mm))
    return FormErrors(
        plane_form_mm=float(np.sqrt(np.mean(np.square(flat)))),
        planes_rms_mm=float(np.sqrt(np.mean(np.sum(off**2, axis=1)))),
        cylinder_radius_mm=fit_cylinder(cylinder).radius_mm - scale * CYLINDER_RADIUS_MM,
        ball_radius_mm=float(np.mean([ball.radius_mm for ball in found])) - scale * BALL_RADIUS_MM,
        ball_distance_mm=apart - scale * float(np.linalg.norm(np.subtract(*BALLS_MM))),
    )


def _rays(rig: Rig, step: int) -> Array:
    """``(n, 3)`` rays, z = 1, of every so many pixels each way."""
    y, x = np.mgrid[: rig.camera.height : step, : rig.camera.width : step].astype(np.float64)
    return pixel_rays(np.column_stack([x.ravel(), y.ravel()]), rig.camera.lens.vector)


def see(rig: Rig, points: Array) -> Seen:
    """What of the points the projector lights, and where both devices have it."""
    lit = project(rig.projector_from_camera.apply(points), rig.projector.lens.vector)
    edge = np.array([rig.projector.width, rig.projector.height]) - 0.5
    inside = np.all((lit > -0.5) & (lit < edge), axis=1)
    points = points[inside]
    seen = project(points, rig.camera.lens.vector)
    return Seen(points, seen, lit[inside], float(inside.mean()))


def meet_plane(rays: Array, z_mm: float, turn_deg: tuple[float, float, float]) -> Array:
    """Where rays meet the plane through (0, 0, z), turned so from facing the camera."""
    normal = rotation_matrix(np.deg2rad(np.array(turn_deg)))[:, 2]
    return np.asarray(rays * (normal[2] * z_mm / (rays @ normal))[:, None])


def _meet_cylinder(rays: Array) -> Array:
    """Upright, so that only x and z count."""
    points = _meet_round(rays, np.array(CYLINDER_MM), (1.0, 0.0, 1.0), CYLINDER_RADIUS_MM)
    return points[np.abs(points[:, 1] - CYLINDER_MM[1]) < CYLINDER_HALF_MM]


def _meet_ball(rays: Array, middle: Array) -> Array:
    return _meet_round(rays, middle, (1.0, 1.0, 1.0), BALL_RADIUS_MM)


def _meet_round(
    rays: Array, middle: Array, counts: tuple[float, float, float], radius: float
) -> Array:
    """Nearer meeting with a surface at `radius` from `middle` in the axes that count."""
    weigh = np.array(counts)
    square = (weigh * rays**2).sum(axis=1)
    half = (weigh * rays) @ middle
    root = half**2 - square * (float(weigh @ middle**2) - radius**2)
    hit = root > 0
    points = rays[hit] * ((half[hit] - np.sqrt(root[hit])) / square[hit])[:, None]
    outwards = weigh * (points - middle) / radius
    facing = -np.einsum("ni,ni->n", outwards, points) / np.linalg.norm(points, axis=1)
    return np.asarray(points[facing > FACING])
