"""By how much a scene moves in the camera's image from frame to frame, from the frames alone.

The mean images of the fringe sets and the white frame show the scene without fringes, each at its
own moment; the two farthest apart in time are laid on each other, from coarse to fine.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from fringeworks.diagnose.motion import image_shift
from fringeworks.errors import DecodeError
from fringeworks.model import Capture, FloatMap, Fringe
from fringeworks.phase.motion import frame_times

SHRINKS = (8, 4, 2, 1)
ROUNDS = 3
LEAST_MOVE_PX = 0.3
"""Camera px over the capture; the edges of shadows alone make still scenes of the twin seem to
move by 0.17."""

LEAST_SIDE_PX = 40


def estimate_image_motion(capture: Capture) -> tuple[float, float]:
    """Camera px ``(x, y)`` per frame; zeros where the image moves by less than can be told.

    Raises
    ------
    DecodeError
        There are no two such images at different moments.
    """
    views = sorted(_views(capture), key=lambda view: view[0])
    if len(views) < 2:
        raise DecodeError(
            "the scene's motion cannot be estimated from one set of fringes without a white "
            "frame: say it, --motion DX,DY in camera px per frame"
        )
    (start, first), (end, last) = views[0], views[-1]
    moved = _lay(first, last)
    if np.hypot(*moved) < LEAST_MOVE_PX:
        return 0.0, 0.0
    x, y = moved / (end - start)
    return float(x), float(y)


def _views(capture: Capture) -> Iterator[tuple[float, FloatMap]]:
    """Mean moment and mean image of every fringe set, and of white."""
    white, times = capture.sequence.white_set, frame_times(capture.sequence)
    for place, (item, stack) in enumerate(capture):
        if isinstance(item.pattern, Fringe):
            yield float(np.mean(times[place])), np.asarray(stack.mean(axis=0, dtype=np.float32))
        elif place == white:
            half = np.asarray(stack.mean(axis=0, dtype=np.float32) / 2)
            yield float(np.mean(times[place])), half


def _lay(first: FloatMap, last: FloatMap) -> NDArray[np.float64]:
    """``(x, y)`` px by which the last image is shifted; at each size to first order, repeatedly."""
    import cv2
    from scipy.ndimage import shift

    moved = np.zeros(2)
    for shrink in SHRINKS:
        if min(first.shape) / shrink < LEAST_SIDE_PX:
            continue
        small = 1 / shrink
        one, other = (
            cv2.resize(view, None, fx=small, fy=small, interpolation=cv2.INTER_AREA).astype(
                np.float32
            )
            for view in (first, last)
        )
        for _ in range(ROUNDS):
            back = shift(other, -moved[::-1] * small, order=1, mode="nearest")
            moved = moved + image_shift(one, np.asarray(back, np.float32)) * shrink
    return moved
