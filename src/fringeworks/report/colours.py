"""Clouds coloured by one of their coordinates, as in the paper's figures 9 and 14."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
from matplotlib.colors import Normalize

from fringeworks.model import Cloud
from fringeworks.report.canvas import Shade
from fringeworks.report.cloud import DEPTH

Coordinate = Literal["x", "y", "z"]


def paint_cloud(cloud: Cloud, by: Coordinate) -> Cloud:
    """The cloud with 8 bit colours of a coordinate in its frame, over its 1 to 99 percentiles.

    z takes the colours of the depth maps: near is light.
    """
    shade = DEPTH if by == "z" else Shade(f"{by}, mm")
    values = cloud.xyz[..., "xyz".index(by)]
    scale = Normalize(*shade.limits_of(values), clip=True)
    colours = np.rint(255 * shade.colormap(scale(values))[..., :3]).astype(np.uint8)
    return replace(cloud, colour=colours)
