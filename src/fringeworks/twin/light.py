"""From the image that a projector shows to the light that leaves it.

The image is taken as pixels, never as the pattern's description: grey level -> response ->
pixels of the lattice's shape -> point spread. An image that is constant along one axis, as every
fringe and code is, becomes a strip; any other one a raster. Both are a `LightTable`, blurred to
several widths: defocus grows with the distance from the focal plane, and between two widths light
is linear in the variance, as the heat equation has it for small steps.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import ShapeError, UsageError
from fringeworks.kernels.forming import Floats, gather_light, paint_raster
from fringeworks.model import AXES, Axis, Frames
from fringeworks.twin.blur import blur
from fringeworks.twin.effects import ProjectorEffects
from fringeworks.twin.lattice import (
    PER_PX,
    StripResponse,
    interpolate,
    spread_strip,
    strip_responses,
)

Array: TypeAlias = NDArray[np.float64]

RASTER_PER_PX = 4
LEAST_PER_ROW = 2
LEVEL_RATIO = 1.25
"""From one width of blur to the next. The worst error of reading between them, 0.4 % of a step's
height, is that of ``(S2 - S1)^2 / 8`` times an edge's second derivative by the variance S."""

LEAST_SIGMA_PX = 0.1
MOST_SIGMA_PX = 50.0
SIGMAS_KEPT = 4.0


@dataclass(frozen=True, slots=True, eq=False)
class LightTable:
    """Light of one shown image, as a share of white's, before distance and angle.

    Attributes
    ----------
    values
        ``(levels, across, along)`` float32, one level per width of the point spread.
    axis
        The projector axis that runs along.
    start_px
        Projector coordinates of the first sample along and across.
    per_px
        Samples per projector pixel, along and across.
    wraps
        Whether the samples across are one period of the lattice.
    limits_px
        Edges of the image across; infinite where the table itself falls off.
    variances_px
        ``(levels,)``: the point spread's variance across, px^2.
    """

    values: Floats
    axis: Axis
    start_px: tuple[float, float]
    per_px: tuple[int, int]
    wraps: bool
    limits_px: tuple[float, float]
    variances_px: Array

    def gather(self, samples: Floats) -> Floats:
        """Irradiance ``(H, W)`` at rays ``(H, W, 4)``: their gain times the light (`shade`)."""
        out = np.empty(samples.shape[:2], np.float32)
        (start, start_across), (per_px, per_px_across) = self.start_px, self.per_px
        along = AXES.index(self.axis)
        grid = (along, start, start_across, float(per_px), float(per_px_across), self.wraps)
        gather_light(samples, self.values, grid, (*self.limits_px, self.variances_px), out)
        return out


@dataclass(frozen=True, eq=False)
class Lamp:
    """A projector's light engine, made ready for some widths of the point spread.

    Attributes
    ----------
    effects
        What the projector does to light.
    width, height
        Its image, px.
    row_ratio
        Rows per column of the same angle, fy / fx: a point spread is round in angle.
    sigmas_px
        ``(levels,)``, rising: standard deviations of the point spread, columns.
    """

    effects: ProjectorEffects
    width: int
    height: int
    row_ratio: float
    sigmas_px: Array

    def light(self, image: Frames) -> Floats:
        """Light ``(H, W)``, as a share of white's, of each pixel of an image ``(H, W)``.

        Raises
        ------
        ShapeError
            The image is not the projector's size.
        UsageError
            It holds levels above ``2^bits - 1``.
        """
        if image.shape != (self.height, self.width):
            raise ShapeError(f"image must be {(self.height, self.width)}, got {image.shape}")
        highest, most = int(image.max()), len(self._light_of_level) - 1
        if highest > most:
            raise UsageError(f"levels of the image must be at most {most}, got {highest}")
        return self._light_of_level[image]

    def show(self, image: Frames) -> LightTable:
        """The light of an image ``(H, W)`` of grey levels; fails as `light` does."""
        light = self.light(image)
        if (light == light[:1]).all():
            return self._strip(light[0], "x")
        if (light == light[:, :1]).all():
            return self._strip(light[:, 0], "y")
        return self._raster(light)

    def _strip(self, light: Floats, axis: Axis) -> LightTable:
        margin = self._margins[AXES.index(axis)]
        if self.effects.lattice == "none":
            smooth = interpolate(light.astype(np.float64), PER_PX, margin)[None]
            values = self._blurred(smooth.astype(np.float32), axis, (PER_PX, PER_PX))
        else:
            values = spread_strip(light, self._responses[axis], margin)
        first = -0.5 + 0.5 / PER_PX
        return LightTable(
            values,
            axis,
            start_px=(first - margin, first + 0.5),
            per_px=(PER_PX, PER_PX),
            wraps=True,
            limits_px=self._limits(axis),
            variances_px=self._sigmas("y" if axis == "x" else "x") ** 2,
        )

    def _limits(self, axis: Axis) -> tuple[float, float]:
        """Edges, across, of a strip along `axis`; light without pixels is cut by its receiver.

        Odd rows of the diamond lattice stand half a column to the right: on average their edges
        and those of even rows do by a quarter.
        """
        match self.effects.lattice:
            case "none":
                return -math.inf, math.inf
            case "diamond" if axis == "y":
                return -0.25, self.width - 0.25
            case _:
                return -0.5, (self.height if axis == "x" else self.width) - 0.5

    def _raster(self, light: Floats) -> LightTable:
        margins = self._margins
        per_row = max(LEAST_PER_ROW, round(RASTER_PER_PX / self.row_ratio))
        per_px = (RASTER_PER_PX, per_row)
        if self.effects.lattice == "none":
            tall = interpolate(light, per_row, margins[1])
            raster = np.ascontiguousarray(interpolate(tall.T, RASTER_PER_PX, margins[0]).T)
        else:
            rows, columns = (
                (count + 2 * margin) * per
                for count, margin, per in zip(light.shape, margins[::-1], per_px[::-1], strict=True)
            )
            raster = np.empty((rows, columns), np.float32)
            paint_raster(light, per_px, margins, self.effects.lattice == "diamond", raster)
        start = tuple(-0.5 + 0.5 / per - m for per, m in zip(per_px, margins, strict=True))
        return LightTable(
            self._blurred(raster, "x", per_px),
            "x",
            start_px=(start[0], start[1]),
            per_px=per_px,
            wraps=False,
            limits_px=(-math.inf, math.inf),
            variances_px=np.zeros(len(self.sigmas_px)),
        )

    def _blurred(self, raster: Floats, axis: Axis, per_px: tuple[int, int]) -> Floats:
        """All levels ``(levels, across, along)`` of a raster ``(across, along)``.

        Reading on straight lines between samples spreads a step over one of them, variance 1/12;
        each level is blurred from the one before.
        """
        axes: tuple[Axis, Axis] = AXES if axis == "x" else ("y", "x")
        along, across = (
            np.maximum((self._sigmas(one) * per) ** 2 - 1 / 12, 0)
            for one, per in zip(axes, per_px, strict=True)
        )
        if len(raster) == 1:
            across = np.zeros_like(across)
        levels = np.empty((len(self.sigmas_px), *raster.shape), np.float32)
        steps = zip(np.diff(along, prepend=0), np.diff(across, prepend=0), strict=True)
        for level, (step_along, step_across) in zip(levels, steps, strict=True):
            raster = blur(raster, across=step_along, down=step_across)
            level[:] = raster
        return levels

    def _sigmas(self, axis: Axis) -> Array:
        return self.sigmas_px if axis == "x" else self.sigmas_px * self.row_ratio

    @cached_property
    def _margins(self) -> tuple[int, int]:
        """Pixels around the image, right and down, that the point spread can reach."""
        reach = (SIGMAS_KEPT * float(self._sigmas(axis)[-1]) for axis in AXES)
        right, down = (2 + math.ceil(px) for px in reach)
        return right, down

    @cached_property
    def _responses(self) -> dict[Axis, list[StripResponse]]:
        along, across = self._sigmas("x"), self._sigmas("y")
        lattice = self.effects.lattice
        return {
            "x": strip_responses(lattice, "x", along_px=along, across_px=across),
            "y": strip_responses(lattice, "y", along_px=across, across_px=along),
        }

    @cached_property
    def _light_of_level(self) -> Floats:
        most = 2**self.effects.bits - 1
        light = respond(np.arange(most + 1) / most, self.effects)
        black = self.effects.black_light
        return (black + (1 - black) * light).astype(np.float32)


def respond(level: Array, effects: ProjectorEffects) -> Array:
    """Light of levels 0 .. 1: by the response's points, else by gamma."""
    if not effects.response:
        return np.asarray(level**effects.gamma)
    from scipy.interpolate import PchipInterpolator

    levels, light = np.array(effects.response).T
    return np.asarray(PchipInterpolator(levels, light)(np.clip(level, levels[0], levels[-1])))


def blur_sigma_px(depth_mm: Array, effects: ProjectorEffects) -> Array:
    """Standard deviation, columns, of the point spread at depths along the projector's axis.

    At most `MOST_SIGMA_PX`: fringes of 100 px have faded to a hundredth there.
    """
    away = 1000 / depth_mm - 1000 / effects.focus_mm
    return np.minimum(np.hypot(effects.blur_px, effects.defocus_px_m * away), MOST_SIGMA_PX)


def choose_sigmas(least_px: float, most_px: float) -> Array:
    """Widths of blur from the least to the most, in steps of `LEVEL_RATIO`; one where all agree.

    Below `LEAST_SIGMA_PX`, where a point spread is narrower than the table's samples, one step
    leads down to the least.
    """
    low = max(least_px, min(LEAST_SIGMA_PX, most_px))
    steps = math.ceil(math.log(most_px / low) / math.log(LEVEL_RATIO)) if low > 0 else 0
    sigmas = np.geomspace(low, most_px, steps + 1) if steps else np.array([most_px])
    if least_px < sigmas[0]:
        sigmas = np.concatenate([[least_px], sigmas])
    return sigmas
