"""From captures of a board to a rig.

`corners` finds the board in the camera's image, `observe` reads where in the projector each corner
lies (`local_fit`), `start` guesses, `bundle` refines everything at once, and `solve` glues them
and refuses what cannot be trusted. `projected` is the paper's own way. `docs/calibrate.md` is the
guide.
"""

from fringeworks.calibrate.corners import find_corners
from fringeworks.calibrate.observe import View, observe_board
from fringeworks.calibrate.projected import calibrate_paper
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
