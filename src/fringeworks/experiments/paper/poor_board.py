"""A cheap board and how a poor rig's camera finds its corners, printed and projected: no images."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.observe import View
from fringeworks.calibrate.projected.camera import PosedView
from fringeworks.calibrate.projected.corners import ProjectedCorners
from fringeworks.geometry.lens import pixel_rays, project
from fringeworks.model import Pose, Rig
from fringeworks.twin.scenes import BOARD, BOARD_POSES, board_pose, target_of

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Priors:
    """What a rig is drawn from; standard deviations unless said.

    Attributes
    ----------
    corner_px
        Of a printed corner, camera px along x and y. With the print's own 0.02 mm, 0.066 px, that
        makes the paper's reprojection error of 0.0987 and 0.0905 px.
    projected_px
        Of a projected corner, projector px along x and y: the paper's.
    print_scale
        Share by which the print is too large along x, and along y.
    print_mm
        Of each printed corner's place.
    bow_mm
        Height of the board's middle over its edges, drawn evenly between the two along x, and y.
    resolution
        Camera pixels per pixel of the paper's, along each axis.
    phase_rad
        By how much the origin of phase, phi_0, is off for the paper's models: no deviation, a
        value.
    """

    corner_px: tuple[float, float] = (0.073, 0.062)
    projected_px: tuple[float, float] = (0.77058, 0.48506)
    print_scale: float = 1e-3
    print_mm: float = 0.02
    bow_mm: tuple[float, float] = (0.05, 0.2)
    resolution: int = 1
    phase_rad: float = 0.0


POOR = Priors()


@dataclass(frozen=True, slots=True, eq=False)
class Sheet:
    """A printed board as it is: scale along x and y, corners ``(n, 2)`` off by mm, bow, mm."""

    scale: Array
    off_mm: Array
    bow_mm: Array

    @classmethod
    def draw(cls, priors: Priors, rng: np.random.Generator) -> Sheet:
        scale = priors.print_scale * rng.standard_normal(2)
        off = priors.print_mm * rng.standard_normal((BOARD.columns * BOARD.rows, 2))
        bow = rng.uniform(*priors.bow_mm, 2) * rng.choice([-1.0, 1.0], 2)
        return cls(scale, off, bow)

    def height(self, xy: Array) -> Array:
        """Heights z of the sheet at places ``(n, 2)``, mm, towards the camera where negative."""
        half = np.array([BOARD.columns + 1, BOARD.rows + 1]) * BOARD.square_mm / 2
        middle = np.array([BOARD.columns - 1, BOARD.rows - 1]) * BOARD.square_mm / 2
        across = (xy - middle) / half
        return np.asarray(-(1 - across**2) @ self.bow_mm)

    def corners(self) -> Array:
        """``(n, 3)`` where the printed corners are."""
        nominal = target_of(BOARD).corners_mm()[:, :2]
        xy = nominal * (1 + self.scale) + self.off_mm
        return np.column_stack([xy, self.height(xy)])

    def meet(self, origin: Array, directions: Array) -> Array:
        """``(n, 3)`` where rays of the board's frame meet the sheet, which is nearly flat."""
        points = origin - directions * (origin[2] / directions[:, 2:])
        for _ in range(3):
            rise = self.height(points[:, :2])
            points = origin + directions * ((rise - origin[2]) / directions[:, 2])[:, None]
        return np.asarray(points)


def see_pose(
    place: int, board: Sheet, rig: Rig, *, priors: Priors, rng: np.random.Generator
) -> PosedView:
    """Printed and projected corners of a pose, as the camera finds them."""
    pose = board_pose(*BOARD_POSES[place])
    nominal = target_of(BOARD).corners_mm()
    seen = project(pose.apply(board.corners()), rig.camera.lens.vector)
    seen = seen + rng.standard_normal(seen.shape) * priors.corner_px
    void = np.full_like(seen, np.nan)
    none = np.full_like(seen, 0.1)
    printed = View(f"pose_{place:02d}", nominal, seen, void, none, void, ("",) * len(seen))
    return PosedView(printed, _project_corners(pose, board, rig, priors=priors, rng=rng))


def _project_corners(
    pose: Pose, board: Sheet, rig: Rig, *, priors: Priors, rng: np.random.Generator
) -> ProjectedCorners:
    """As many as are printed, on squares of about their size.

    Their noise is the paper's of the projector, in camera px: what a camera px there is in
    projector px, the lenses' focal lengths and both devices' distance tell.
    """
    lens = rig.projector.lens
    corners = _projector_lattice(pose, rig)
    rays = pixel_rays(corners, lens.vector)
    turned = rays @ rig.projector_from_camera.rotation @ pose.rotation
    centre = rig.projector_from_camera.inverse().translation_mm
    origin = pose.inverse().apply(centre)
    places = board.meet(origin, turned)
    in_camera = pose.apply(places)
    camera = rig.camera.lens
    reach = rig.projector_from_camera.apply(in_camera)[:, 2:] / in_camera[:, 2:]
    per_px = reach * np.array([camera.fx / lens.fx, camera.fy / lens.fy])
    noise = rng.standard_normal(corners.shape) * np.array(priors.projected_px) * per_px
    seen = project(in_camera, camera.vector) + noise
    sigma = np.full_like(seen, 0.5)
    return ProjectedCorners(corners, seen, sigma, ("",) * len(seen), cut=0)


def _projector_lattice(pose: Pose, rig: Rig) -> Array:
    """``(n, 2)`` projector px: 11x8 places that lie about where the board's corners are."""
    shown = project(
        rig.projector_from_camera.apply(pose.apply(target_of(BOARD).corners_mm())),
        rig.projector.lens.vector,
    )
    (left, top), (right, bottom) = shown.min(axis=0), shown.max(axis=0)
    x = np.round(np.linspace(left, right, BOARD.columns))
    y = np.round(np.linspace(top, bottom, BOARD.rows))
    return np.column_stack([part.ravel() for part in np.meshgrid(x, y)]).astype(np.float64)
