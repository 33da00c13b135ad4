"""The automatic gain of a V4L2 camera, which OpenCV has no name for."""

from __future__ import annotations

import errno
import struct
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from fringeworks.errors import DeviceError

GET_CONTROL, SET_CONTROL = 0xC008561B, 0xC008561C
"""The ioctls VIDIOC_G_CTRL and VIDIOC_S_CTRL."""

AUTO_GAIN = 0x00980912
"""V4L2_CID_AUTOGAIN."""

DEVICES = Path("/dev")

_CONTROL = struct.Struct("=Ii")
"""Which control, and its value."""

Ioctl = Callable[[Any, int, bytes], bytes]


def switch_off_auto_gain(index: int, *, ioctl: Ioctl | None = None) -> None:
    """Turn the automatic gain of ``/dev/video<index>`` off, where it has one.

    Elsewhere than on Linux nothing happens: Media Foundation has no such control.

    Raises
    ------
    DeviceError
        It stays on.
    """
    if sys.platform != "linux":
        return
    import fcntl

    if _stays_on(DEVICES / f"video{index}", ioctl or fcntl.ioctl):
        raise DeviceError(f"webcam {index}: its automatic gain cannot be turned off")


def _stays_on(path: Path, ioctl: Ioctl) -> bool:
    try:
        with path.open("r+b", buffering=0) as device:
            ioctl(device, SET_CONTROL, _CONTROL.pack(AUTO_GAIN, 0))
            answer = ioctl(device, GET_CONTROL, _CONTROL.pack(AUTO_GAIN, 0))
    except OSError as error:
        return error.errno not in (errno.EINVAL, errno.ENOTTY)  # those say that there is none
    return bool(_CONTROL.unpack(answer)[1])
