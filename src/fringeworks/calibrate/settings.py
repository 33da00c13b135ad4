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

    k1 and k2 are free, and k3 where cross-validation wants it: on a narrow lens it does nothing but
    scatter. p1 and p2 are free and held loosely: three views of a board hardly tell them from the
    principal point, a dozen do, and lenses have them.

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
    try_k3
        Whether k3 of a lens is set free where cross-validation wants it, see `cross_validate`.
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
    try_k3: bool = True

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
