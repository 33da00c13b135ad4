"""The choices of a calibration, as frozen values."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias, get_args

from fringeworks.errors import UsageError
from fringeworks.geometry.lens import LENS_NAMES

BoardModel: TypeAlias = Literal["flat", "paraboloid"]
LENS_DEFAULT = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2")


@dataclass(frozen=True, slots=True)
class ImageSize:
    """Width and height of an image, px."""

    width: int
    height: int


@dataclass(frozen=True, slots=True)
class CalibrationSettings:
    """What is solved for, and how.

    The defaults were chosen when corners alone were used, and their figures are from then. They
    stand on the four poses of the real capture procam-graycode and its copy of half
    the size (leave one pose out, calibrate from the other three, measure the squares, 75 mm, of
    the fourth), and on rendered captures of lenses with decentring. On the former k1 and k2 alone
    give squares within 0.04 mm (half size: 0.05), p1 and p2 set free 0.11 mm (0.18), held
    by `decentring_sigma` 0.05 mm (0.07). On the latter, 12 poses and |p| of 1e-3, holding them at
    zero leaves 0.035 mm on a wall and moves principal points by 5 px; held loosely they come
    out and 0.015 mm is left. k3 buys nothing. Plain least squares with nothing left out
    errs by up to 0.21 mm (0.24): one corner of that board is curled by several millimetres.

    Attributes
    ----------
    camera_free, projector_free
        Lens parameters that the refinement moves; the others stay zero.
    window_squares
        Radius of the window in which a corner's projector coordinate is fitted, in squares as
        they appear in the image. Below 1 the window stays on the board.
    huber
        Residuals beyond this many standard deviations (estimated from the residuals) pull
        linearly instead of quadratically.
    trim_share, trim_sigmas
        The worst corners beyond `trim_sigmas` standard deviations are left out, and counted, but
        never more than this share of all.
    decentring_sigma
        p1 and p2 are zero to within this standard deviation before any view is looked at. Few
        views hardly tell them from the principal point; many do, and this hardly holds them.
    board_shape
        Of all views: a plane, or a paraboloid whose two heights are solved for too.
    dense
        Whether the decoded maps are read all over the board, or about its corners alone.
    """

    camera_free: tuple[str, ...] = LENS_DEFAULT
    projector_free: tuple[str, ...] = LENS_DEFAULT
    window_squares: float = 0.9
    huber: float = 2.0
    trim_share: float = 0.02
    trim_sigmas: float = 6.0
    decentring_sigma: float = 5e-4
    board_shape: BoardModel = "flat"
    dense: bool = True

    def __post_init__(self) -> None:
        unknown = {*self.camera_free, *self.projector_free} - set(LENS_NAMES)
        if unknown:
            raise UsageError(
                f"free lens parameters must be among {', '.join(LENS_NAMES)}, "
                f"got {', '.join(sorted(unknown))}"
            )
        if not 0 < self.window_squares <= 3:
            raise UsageError(f"window_squares must be in (0, 3], got {self.window_squares:g}")
        for name in ("huber", "trim_sigmas", "decentring_sigma"):
            if not getattr(self, name) > 0:
                raise UsageError(f"{name} must be above 0, got {getattr(self, name):g}")
        if self.board_shape not in get_args(BoardModel):
            raise UsageError(
                f"board_shape must be one of {', '.join(get_args(BoardModel))}, "
                f"got {self.board_shape}"
            )
        if not 0 <= self.trim_share < 0.5:
            raise UsageError(f"trim_share must be in [0, 0.5), got {self.trim_share:g}")
