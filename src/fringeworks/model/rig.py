"""Lens, camera, projector, rig: what a calibration finds and a scan uses.

Frames are right-handed (x right, y down, z forward), lengths mm. A pose `a_from_b` maps
``X_a = R X_b + t``. The rig's frame is the camera's.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from fringeworks.geometry.pose import invert_pose
from fringeworks.model.residual import ResidualField
from fringeworks.model.sequence import Axis


@dataclass(frozen=True, slots=True)
class Lens:
    """Focal lengths and principal point, px, and OpenCV's five-term distortion."""

    fx: float
    fy: float
    cx: float
    cy: float
    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    k3: float = 0.0

    @property
    def vector(self) -> NDArray[np.float64]:
        """``(9,)``: fx, fy, cx, cy, k1, k2, p1, p2, k3, as `geometry` and `kernels` take it."""
        return np.array(
            [self.fx, self.fy, self.cx, self.cy, self.k1, self.k2, self.p1, self.p2, self.k3]
        )

    @classmethod
    def from_vector(cls, vector: NDArray[np.floating]) -> Lens:
        return cls(*(float(value) for value in vector))


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """A rigid motion ``X_a = rotation @ X_b + translation_mm``."""

    rotation: NDArray[np.float64]
    translation_mm: NDArray[np.float64]

    @classmethod
    def identity(cls) -> Pose:
        return cls(np.eye(3), np.zeros(3))

    def inverse(self) -> Pose:
        return Pose(*invert_pose(self.rotation, self.translation_mm))

    def apply(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        """Points ``(..., 3)``, mm, moved from frame b to frame a."""
        return np.asarray(points @ self.rotation.T + self.translation_mm, dtype=np.float64)


@dataclass(frozen=True, slots=True)
class Camera:
    """Image size, px, and lens of the camera."""

    width: int
    height: int
    lens: Lens


@dataclass(frozen=True, slots=True)
class Projector:
    """Image size, px, and lens of the projector: a camera that looks backwards along its rays."""

    width: int
    height: int
    lens: Lens


@dataclass(frozen=True, slots=True)
class Quality:
    """How well the calibration's observations fit: root mean squared distances per point, px."""

    camera_rms_px: float
    projector_rms_px: float
    joint_rms_px: float
    views_used: int
    observations_used: int
    observations_offered: int


@dataclass(frozen=True, slots=True)
class Extended:
    """The paper's ten parameters (its equations 4 to 7); all zero, they change nothing.

    They belong to fringes along `axis` of `period_px`, projector px. C1, C2 and Kz are mm, C3 and
    C4 have no unit, Kfp, Ku0, Kv0 and Kfc are px, Kphi is rad.
    """

    NAMES: ClassVar[tuple[str, ...]] = (
        "C1",
        "C2",
        "C3",
        "C4",
        "Kfp",
        "Kphi",
        "Ku0",
        "Kv0",
        "Kfc",
        "Kz",
    )

    axis: Axis
    period_px: float
    C1: float = 0.0
    C2: float = 0.0
    C3: float = 0.0
    C4: float = 0.0
    Kfp: float = 0.0
    Kphi: float = 0.0
    Ku0: float = 0.0
    Kv0: float = 0.0
    Kfc: float = 0.0
    Kz: float = 0.0

    @property
    def vector(self) -> NDArray[np.float64]:
        """``(10,)`` in the order of `NAMES`, as `kernels` takes it."""
        return np.array([getattr(self, name) for name in self.NAMES], dtype=np.float64)

    @classmethod
    def from_vector(cls, vector: NDArray[np.floating], *, axis: Axis, period_px: float) -> Extended:
        return cls(axis, period_px, *(float(value) for value in vector))


@dataclass(frozen=True, slots=True)
class Rig:
    """One camera and one projector that have been calibrated together.

    `volume_mm` is the depth range (z of the camera frame) that the calibration poses covered.
    `scale_sigma` is how well the scale of all lengths is known, a share, one standard deviation;
    None where nobody knows. `extended` are the paper's ten parameters, where they were fitted;
    `residual` what models leave, at most one field of each model and axis.
    `further` keeps the other keys of the rig's file: its calibration's observations, response...
    """

    camera: Camera
    projector: Projector
    projector_from_camera: Pose
    volume_mm: tuple[float, float] | None = None
    quality: Quality | None = None
    scale_sigma: float | None = None
    extended: Extended | None = None
    residual: tuple[ResidualField, ...] = ()
    further: Mapping[str, Any] = field(default_factory=dict)

    @property
    def baseline_mm(self) -> float:
        """Distance of the two centres of projection."""
        return float(np.linalg.norm(self.projector_from_camera.translation_mm))

    def z_window(self, widen: float = 0.1) -> tuple[float, float] | None:
        """The calibrated depth range widened by a share of itself at both ends, mm."""
        if self.volume_mm is None:
            return None
        near, far = self.volume_mm
        return near - widen * (far - near), far + widen * (far - near)
