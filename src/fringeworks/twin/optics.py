"""The twin's devices: more than our own calibration can describe, so that no result is a tautology.

Beyond the five terms a device may have OpenCV's rational terms k4, k5, k6 and a pupil that moves
along its axis with the angle of view (slightly non-central, as real lenses are). A rig says so
under ``further["twin"]``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import UsageError
from fringeworks.kernels.optics import origins_of, pixels_of, rays_of
from fringeworks.model import Camera, Lens, Pose, Projector, Rig
from fringeworks.model.capture import MAX_PIXELS

Array = NDArray[np.float64]

KEY = "twin"
"""Where `Rig.further` keeps what its lenses do beyond the five terms."""

TERMS = ("k4", "k5", "k6", "pupil_shift_mm")

MOST_TERM = 1e6
LEAST_FOCAL_PX, MOST_FOCAL_PX = 1.0, 1e6
"""Distortion, places and focal lengths beyond these are no device's."""

NO_TERM = 1e-30
"""A coefficient of the slope below this folds no lens within any field of view."""

REAL_ROOT = 1e-9
"""Imaginary part, relative, below which a root counts as real."""


@dataclass(frozen=True, slots=True, eq=False)
class Optics:
    """One device with all that its lens does; a projector is a camera that looks backwards.

    Attributes
    ----------
    width, height
        Image size, px.
    lens
        Focal lengths, principal point, five-term distortion.
    rational
        k4, k5, k6: the radial factor is divided by ``1 + k4 r2 + k5 r2^2 + k6 r2^3``.
    pupil_shift_mm
        The ray at ideal normalised radius r starts at z = pupil_shift_mm r^2 on the device's axis.
    device_from_camera
        Where the device stands.
    """

    width: int
    height: int
    lens: Lens
    rational: tuple[float, float, float] = (0.0, 0.0, 0.0)
    pupil_shift_mm: float = 0.0
    device_from_camera: Pose = field(default_factory=Pose.identity)

    def pixel_grid(self) -> Array:
        """Centres ``(H W, 2)`` of the image's pixels, row by row."""
        rows, columns = np.mgrid[: self.height, : self.width].astype(np.float64)
        return np.stack([columns, rows], axis=-1).reshape(-1, 2)

    def rays(self, pixels: Array) -> tuple[Array, Array]:
        """Rays through pixels ``(n, 2)``: origins, mm, and unit directions, both ``(n, 3)``.

        In the camera's frame; NaN where the distortion has no inverse.
        """
        place = self.device_from_camera.inverse().translation_mm
        return rays_of(_plain(pixels), self._vector(), self._rotation, _plain(place))

    def pixels(self, points: Array) -> Array:
        """Pixels ``(n, 2)`` of points ``(n, 3)`` in the camera's frame, mm.

        NaN behind the device and where the lens model folds back.
        """
        translation = _plain(self.device_from_camera.translation_mm)
        return pixels_of(_plain(points), self._vector(), self._rotation, translation)

    def origins_of(self, points: Array) -> Array:
        """Where the ray through each point starts: ``(n, 3)``, mm, in the camera's frame."""
        place = self.device_from_camera.inverse().translation_mm
        translation = _plain(self.device_from_camera.translation_mm)
        vector = self._vector()
        return origins_of(_plain(points), vector, self._rotation, translation, _plain(place))

    def depths(self, points: Array) -> Array:
        """Depth ``(n,)`` of points ``(n, 3)`` along the device's own axis, mm."""
        pose = self.device_from_camera
        return np.asarray(points @ pose.rotation[2] + pose.translation_mm[2])

    def inside(self, pixels: Array) -> NDArray[np.bool_]:
        """Whether pixels ``(n, 2)`` lie in the image, half a pixel around the outer centres."""
        x, y = pixels[:, 0], pixels[:, 1]
        across = (x >= -0.5) & (x <= self.width - 0.5)
        return np.asarray(across & (y >= -0.5) & (y <= self.height - 0.5))

    @property
    def _rotation(self) -> Array:
        return _plain(self.device_from_camera.rotation)

    def _vector(self) -> Array:
        """``(14,)``, as `kernels.optics` takes it."""
        rest = [*self.rational, self.pupil_shift_mm, _fold(self.lens, self.rational)]
        return np.concatenate([self.lens.vector, rest])


def optics_of(rig: Rig) -> tuple[Optics, Optics]:
    """Camera and projector of a rig, with what ``rig.further["twin"]`` adds to their lenses.

    Raises
    ------
    UsageError
        Something in ``further["twin"]`` is not one of `TERMS` of a device, or no number within
        bounds; a focal length, term, place or number of pixels that no device has.
    """
    table = rig.further.get(KEY, {})
    _refuse_unknown(table, ("camera", "projector"), f"rig.{KEY}")
    camera = _optics(rig.camera, table, "camera", Pose.identity())
    return camera, _optics(rig.projector, table, "projector", rig.projector_from_camera)


def _optics(device: Camera | Projector, table: Mapping[str, Any], name: str, pose: Pose) -> Optics:
    terms = table.get(name, {})
    where = f"rig.{KEY}.{name}"
    _refuse_unknown(terms, TERMS, where)
    k4, k5, k6, shift = (_number(terms.get(term, 0.0), f"{where}.{term}") for term in TERMS)
    _check_device(device, name, pose)
    return Optics(device.width, device.height, device.lens, (k4, k5, k6), shift, pose)


def _check_device(device: Camera | Projector, name: str, pose: Pose) -> None:
    pixels = device.width * device.height
    if not 0 < pixels <= MAX_PIXELS:
        raise UsageError(
            f"{name} must have at most {MAX_PIXELS} pixels to be simulated, got "
            f"{device.width}x{device.height}"
        )
    lens = device.lens
    for key in ("fx", "fy"):
        focal = getattr(lens, key)
        if not LEAST_FOCAL_PX <= focal <= MOST_FOCAL_PX:
            bounds = f"{LEAST_FOCAL_PX:g} to {MOST_FOCAL_PX:g} px"
            raise UsageError(f"{name}.{key} must be {bounds}, got {focal:g}")
    for key in ("cx", "cy", "k1", "k2", "p1", "p2", "k3"):
        _number(getattr(lens, key), f"{name}.{key}")
    for value in pose.translation_mm.tolist():
        _number(value, f"{name}'s translation_mm")


def _refuse_unknown(table: object, known: tuple[str, ...], name: str) -> None:
    if not isinstance(table, Mapping):
        raise UsageError(f"{name} must be a table, got {type(table).__name__}")
    unknown = sorted(str(key) for key in set(table) - set(known))
    if unknown:
        raise UsageError(f"{name} must have keys of {', '.join(known)}, got {', '.join(unknown)}")


def _number(value: object, name: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or value != value:
        raise UsageError(f"{name} must be a finite number, got {value!r}")
    if abs(value) > MOST_TERM:
        raise UsageError(f"{name} must be -{MOST_TERM:g} to {MOST_TERM:g}, got {value!r}")
    return float(value)


def _plain(array: Array) -> Array:
    return np.ascontiguousarray(array, dtype=np.float64)


def _fold(lens: Lens, rational: tuple[float, float, float]) -> float:
    """Squared ideal radius at which the radial distortion stops rising; inf if it never does.

    With s = r^2, N over D the factor and ' d/ds, the slope of r N / D has the sign of
    ``N D + 2 s (N' D - N D')`` as long as D stays positive.
    """
    over = np.polynomial.Polynomial([1.0, lens.k1, lens.k2, lens.k3])
    under = np.polynomial.Polynomial([1.0, *rational])
    slope = over * under + np.polynomial.Polynomial([0.0, 2.0]) * (
        over.deriv() * under - over * under.deriv()
    )
    return min(_first_root(slope), _first_root(under))


def _first_root(polynomial: np.polynomial.Polynomial) -> float:
    """Least positive root; inf without one."""
    roots = polynomial.trim(NO_TERM).roots()
    real = roots.real[np.abs(roots.imag) <= REAL_ROOT * np.abs(roots)]
    return float(np.min(real[real > 0], initial=np.inf))
