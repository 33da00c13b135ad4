"""The organised cloud: one point per camera pixel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.model.capture import Frames
from fringeworks.model.finding import Finding


@dataclass(frozen=True, slots=True)
class Cloud:
    """Points of one scan on the camera's pixel grid.

    Attributes
    ----------
    xyz
        ``(H, W, 3)`` float32, mm, in the frame called `frame`; NaN where void.
    sigma_mm
        ``(H, W)`` float32: random part of the uncertainty, one standard deviation along z.
    intensity
        ``(H, W)`` float32: grey level of the white frame, or the fringes' offset.
    colour
        ``(H, W, 3)`` RGB of the white frame where the camera saw colour, else None.
    epipolar_px
        ``(H, W)`` float32: what is left between measured and projected coordinate across the
        epipolar line, projector px; NaN everywhere if one axis alone was coded.
    scale_sigma
        How well the scale of all its lengths is known, a share, one standard deviation: that of
        the rig. None where nobody knows.
    findings
        What the user should know of how the points came about.
    """

    xyz: NDArray[np.float32]
    sigma_mm: NDArray[np.float32]
    intensity: NDArray[np.float32]
    epipolar_px: NDArray[np.float32]
    colour: Frames | None = None
    frame: str = "camera"
    scale_sigma: float | None = None
    findings: tuple[Finding, ...] = ()

    @property
    def valid(self) -> NDArray[np.bool_]:
        return np.asarray(np.isfinite(self.xyz).all(axis=-1))

    def points(self) -> NDArray[np.float64]:
        """``(n, 3)`` valid points, mm, row by row."""
        return self.xyz[self.valid].astype(np.float64)
