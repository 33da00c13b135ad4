"""Clouds as text: a point a line, x y z."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np

from fringeworks.errors import FormatError
from fringeworks.files.atomic import replacing
from fringeworks.files.cloud_points import points_cloud
from fringeworks.files.validation import clip
from fringeworks.model import Cloud


def write_xyz_cloud(path: Path, cloud: Cloud) -> None:
    """The valid points, mm."""
    with replacing(path) as temporary:
        np.savetxt(temporary, cloud.xyz[cloud.valid], fmt="%.9g")


def read_xyz_cloud(path: Path) -> Cloud:
    """Points ``(1, n)``; what follows x y z in a line is not looked at."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # an empty file: the shape tells
            points = np.loadtxt(path, usecols=(0, 1, 2), ndmin=2, encoding="utf-8")
    except (ValueError, OSError) as error:
        raise FormatError(f"{path}: not lines of x y z ({clip(error)})") from None
    if points.size == 0:
        raise FormatError(f"{path}: holds no points")
    return points_cloud(path, points[None])
