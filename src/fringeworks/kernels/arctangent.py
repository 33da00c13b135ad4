"""The arctangent of two arguments as an odd polynomial, so that loops over pixels vectorise.

libm's atan2 costs more than all the memory traffic of a demodulation. Here the quotient of the
smaller by the larger argument goes through a minimax polynomial of eight odd terms (error 4e-8
rad over [0, 1]; at most 4e-7 rad in all, in single precision) and then to its octant.
"""

from __future__ import annotations

import numpy as np

from fringeworks.kernels.compiled import inlined

PI = np.float32(np.pi)
HALF_PI = np.float32(np.pi / 2)
ZERO = np.float32(0)
TINY = np.float32(1e-45)
"""Smallest number above zero in single precision: a divisor that changes no quotient but 0 / 0."""

C1 = np.float32(0.9999993355747083)
C3 = np.float32(-0.3332986076931831)
C5 = np.float32(0.19946565474017894)
C7 = np.float32(-0.13908628635674203)
C9 = np.float32(0.09642194925206225)
C11 = np.float32(-0.05591229315048114)
C13 = np.float32(0.021862934037292135)
C15 = np.float32(-0.00405456048027273)


@inlined
def arctangent(y: np.float32, x: np.float32) -> np.float32:
    """Angle of the vector (x, y), rad, in (-pi, pi], single precision; 0 for the null vector.

    Where the angle rounds to -pi it is given as pi, its other name. Zeros have no sign here. NaN
    where either is, and where both are infinite: such a vector has no direction.
    """
    across, up = abs(x), abs(y)
    less = across if across < up else up
    most = up if up > across else across  # of the two, one is NaN where either argument is
    t = less / (TINY if most < TINY else most)
    s = t * t
    angle = t * (C1 + s * (C3 + s * (C5 + s * (C7 + s * (C9 + s * (C11 + s * (C13 + s * C15)))))))
    angle = HALF_PI - angle if up > across else angle
    angle = PI - angle if x < ZERO else angle
    return -angle if y < ZERO and angle < PI else angle
