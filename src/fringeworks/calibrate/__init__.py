"""From captures of a board to a rig.

`boards` finds the corners in the camera's image, `observe` reads where in the projector they lie
(`local_fit`, `dense`), `adjust` solves for all at once, `judge` says what to think of it, and
`solve` glues them and refuses what cannot be trusted. `projected` is the paper's way of the same,
`held` holds a rig against a new view. `docs/calibrate.md` is the guide.
"""

from fringeworks.calibrate.boards.corners import find_corners
from fringeworks.calibrate.observe import View, observe_board
from fringeworks.calibrate.projected.solve import calibrate_paper
from fringeworks.calibrate.settings import CalibrationSettings, ImageSize
from fringeworks.calibrate.solve import calibrate_captures, calibrate_rig

__all__ = [
    "CalibrationSettings",
    "ImageSize",
    "View",
    "calibrate_captures",
    "calibrate_paper",
    "calibrate_rig",
    "find_corners",
    "observe_board",
]
