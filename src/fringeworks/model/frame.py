"""Named frames: what a cloud's coordinates are about."""

from __future__ import annotations

from dataclasses import dataclass

from fringeworks.errors import UsageError
from fringeworks.model.rig import Pose

CAMERA_FRAME = "camera"
UNKNOWN_FRAME = "unknown"
"""Of clouds whose file tells none."""

LONGEST_NAME = 100


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """A frame, such as a board's or a robot's, and its place before the camera.

    Attributes
    ----------
    name
        "board", "station"...
    frame_from_camera
        X_frame = R X_camera + t, mm.
    """

    name: str
    frame_from_camera: Pose

    def __post_init__(self) -> None:
        """Refuse with a UsageError a name that no line of a file or report can hold."""
        if not (0 < len(self.name) <= LONGEST_NAME and self.name.isprintable()):
            raise UsageError(
                f"a frame's name must be 1 to {LONGEST_NAME} printable characters, "
                f"got {self.name[:LONGEST_NAME]!r}"
            )
