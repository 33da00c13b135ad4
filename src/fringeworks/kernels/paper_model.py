"""The paper's phase-to-depth model, equations 1 and 4 to 7, and its derivatives.

With s the row of ``projector_from_camera`` that belongs to the phase axis (x: first, y: second) and
R^-1, T of the paper, which runs from projector to camera:

    z = (F A - w B) / (F C - w D) + Kz
    F = 2 pi (f_s + Kfp) / P          w = 2 pi (u - c_s) / P + Kphi
    A = r_s . T + C1                  B = r_3 . T + C2
    C = r_s1 D1 + r_s2 D2 + r_s3 + C3
    D = r_31 D1 + r_32 D2 + r_33 + C4

which is the paper's fraction multiplied by its ``phi - phi_0``: nothing is divided by a phase that
may be zero. C3 and C4 are added: printed as factors, the reported zeros would delete both terms.
``D1 = (u_c - u0 + Ku0) / (fx + Kfc)`` and D2 likewise, with u_c - u0 that of the undistorted pixel.
Zeros for all ten give equation 1, by the same operations.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.compiled import inlined, kernel
from fringeworks.kernels.lens import undistort

Array = NDArray[np.float64]
Floats = NDArray[np.float32]

TURN = 2 * math.pi


class Equation(NamedTuple):
    """A rig and ten parameters as the scalar functions take them; letters as above.

    `per_px` is 2 pi / P, `centre` c_s, `phase` Kphi and `offset` Kz. The extended ray is
    ``((x + x_shift) x_scale, (y + y_shift) y_scale)``; `along` and `ahead` are the rows s and 3
    of the rotation, their last elements with C3 and C4.
    """

    per_px: float
    centre: float
    phase: float
    focal: float
    a: float
    b: float
    along: tuple[float, float, float]
    ahead: tuple[float, float, float]
    x_shift: float
    y_shift: float
    x_scale: float
    y_scale: float
    x_focal: float
    y_focal: float
    offset: float


@inlined
def extended_ray(x: float, y: float, equation: Equation) -> tuple[float, float]:
    """D1 and D2, equations 6 and 7, of the calibrated ray (x, y, 1)."""
    return (
        (x + equation.x_shift) * equation.x_scale,
        (y + equation.y_shift) * equation.y_scale,
    )


@inlined
def phase_from_centre(coordinate: float, equation: Equation) -> float:
    """``w``, rad: absolute phase less that of the projector's principal point, and Kphi."""
    return (coordinate - equation.centre) * equation.per_px + equation.phase


@inlined
def turned_ray(d1: float, d2: float, equation: Equation) -> tuple[float, float]:
    """C and D: the ray's components along the phase axis and ahead, in the projector's frame."""
    along, ahead = equation.along, equation.ahead
    return (
        along[0] * d1 + along[1] * d2 + along[2],
        ahead[0] * d1 + ahead[1] * d2 + ahead[2],
    )


@inlined
def fraction(w: float, c: float, d: float, equation: Equation) -> tuple[float, float]:
    """Numerator and denominator of equation 4, both times ``phi - phi_0``."""
    return (
        equation.focal * equation.a - w * equation.b,
        equation.focal * c - w * d,
    )


@kernel
def paper_depth(x: float, y: float, coordinate: float, equation: Equation) -> tuple[float, float]:
    """Depth z, mm, and its derivative by the coordinate, mm per px.

    NaN where the point would not lie ahead of the projector.
    """
    d1, d2 = extended_ray(x, y, equation)
    c, d = turned_ray(d1, d2, equation)
    w = phase_from_centre(coordinate, equation)
    up, down = fraction(w, c, d, equation)
    z = up / down
    if not d * z > equation.b:
        return math.nan, math.nan
    slope = (d * z - equation.b) / down * equation.per_px
    return z + equation.offset, slope


@kernel
def triangulate_by_phase(
    coordinate: Floats,
    sigma: Floats,
    camera: Array,
    equation: Equation,
    window: tuple[float, float],
    literal: bool,
    xyz: Floats,
    sigma_z: Floats,
) -> None:
    """Points, mm, of every camera pixel from one axis.

    Parameters
    ----------
    coordinate, sigma
        ``(H, W)``, projector px; NaN where void.
    camera
        Lens ``(9,)``: its distortion is taken out of the ray.
    window
        Depths, mm, outside of which a point is void.
    literal
        x and y are D1 z and D2 z as equations 2 and 3 read, not the calibrated ray's.
    xyz, sigma_z
        Outputs ``(H, W, 3)`` and ``(H, W)``; NaN where void.
    """
    height, width = coordinate.shape
    nan = np.float32(math.nan)
    for v in range(height):
        for u in range(width):
            xyz[v, u, 0], xyz[v, u, 1], xyz[v, u, 2], sigma_z[v, u] = nan, nan, nan, nan
            if math.isnan(coordinate[v, u]):
                continue
            x, y = undistort((u - camera[2]) / camera[0], (v - camera[3]) / camera[1], camera)
            z, slope = paper_depth(x, y, float(coordinate[v, u]), equation)
            if z > window[0] and z < window[1]:
                if literal:
                    x, y = extended_ray(x, y, equation)
                xyz[v, u, 0], xyz[v, u, 1], xyz[v, u, 2] = x * z, y * z, z
                sigma_z[v, u] = abs(slope) * sigma[v, u]


@kernel
def paper_depths(rays: Array, coordinates: Array, equation: Equation) -> tuple[Array, Array]:
    """`paper_depth` of rays ``(2, n)`` with coordinates ``(n,)``: z and its slope, ``(n,)``."""
    z, slope = np.empty_like(coordinates), np.empty_like(coordinates)
    for n in range(len(coordinates)):
        z[n], slope[n] = paper_depth(rays[0, n], rays[1, n], coordinates[n], equation)
    return z, slope
