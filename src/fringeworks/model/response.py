"""The response: what lies between a level that is shown and a grey level that is seen.

Three kinds of correction, by where they act: a `GreyCurve` bends the levels before they are shown
(or says what phase error they make), an `ImageExponent` straightens the images, `PhaseTerms` are
taken from the phase.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.model.sequence import Axis

Waves: TypeAlias = NDArray[np.floating]

Way: TypeAlias = Literal["levels", "gray", "steps", "plane", "periods"]
"""Grey levels (active); against a Gray code, many steps or a plane (passive); from two periods of
one scan (blind)."""

CURVE_SAMPLES = 4096
LIGHT_DIGITS = 12
"""Slopes of less than that overflow."""

TURN_SAMPLES = 720
LEAST_RISE = 1e-9
"""By so much light rises from sample to sample even where the projector's does not: the inverse
has to be a function."""


@dataclass(frozen=True, slots=True)
class RegionCurve:
    """Light of the levels in one part of the camera's image.

    `rows` and `columns` are its first pixel and the one after its last.
    """

    rows: tuple[int, int]
    columns: tuple[int, int]
    light: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class GreyCurve:
    """A projector's light by the level that it is told, joined by a monotone cubic.

    Attributes
    ----------
    levels, light
        Shares of full scale and of the way from black to white, both 0 to 1 and rising.
    harmonics
        a2 / a1 and a3 / a1 of the light of a plain sinusoid: what the curve does.
    left
        The same of a sinusoid that is pre-distorted by every other level and shown by all of
        them: what a correction leaves.
    regions
        The curve by parts of the camera's image; none where they are not told apart.
    """

    levels: tuple[float, ...]
    light: tuple[float, ...]
    harmonics: tuple[float, float] = (0.0, 0.0)
    left: tuple[float, float] = (0.0, 0.0)
    regions: tuple[RegionCurve, ...] = ()

    def light_of(self, level: NDArray[np.float64]) -> NDArray[np.float64]:
        """Light of levels, both 0 to 1."""
        from scipy.interpolate import PchipInterpolator

        light = np.round(self.light, LIGHT_DIGITS)
        return np.asarray(PchipInterpolator(self.levels, light)(np.clip(level, 0.0, 1.0)))

    def level_of(self, light: NDArray[np.float64]) -> NDArray[np.float64]:
        """The level that makes this light, both 0 to 1."""
        levels = np.linspace(0.0, 1.0, CURVE_SAMPLES)
        made = np.maximum.accumulate(self.light_of(levels)) + LEAST_RISE * np.arange(CURVE_SAMPLES)
        return np.interp(light, made, levels)

    @property
    def uneven(self) -> float:
        """Largest difference of a region's light from the whole field's."""
        whole = np.array(self.light)
        return max((float(np.abs(part.light - whole).max()) for part in self.regions), default=0.0)


@dataclass(frozen=True, slots=True)
class ImageExponent:
    """Images are straight in the light once each grey level, a share of full scale, is raised.

    Attributes
    ----------
    exponent
        What it is raised to.
    before_rad, after_rad
        Rms error of the phase without and with it.
    """

    exponent: float
    before_rad: float
    after_rad: float


@dataclass(frozen=True, slots=True)
class PhaseTerms:
    """Error of the wrapped phase of one kind of fringes, as a function of that phase.

    ``delta(phi) = sum_k cos[k - 1] cos(k N phi) + sin[k - 1] sin(k N phi)`` for N steps; the phase
    is ``phi - delta(phi)``.

    Attributes
    ----------
    axis, period_px, shifts_rad
        The fringes that it holds for.
    cos, sin
        Coefficients, rad, of k = 1, 2, ...
    before, after, unit
        What was left without and with them: rms error of the phase, "rad", or median disagreement
        of two periods, "px".
    """

    axis: Axis
    period_px: float
    shifts_rad: tuple[float, ...]
    cos: tuple[float, ...]
    sin: tuple[float, ...]
    before: float = 0.0
    after: float = 0.0
    unit: Literal["rad", "px"] = "rad"

    @property
    def steps(self) -> int:
        """Frames of the fringes."""
        return len(self.shifts_rad)

    @property
    def folds(self) -> bool:
        """Whether the phase without its error would run backwards somewhere."""
        phase = np.linspace(-np.pi, np.pi, TURN_SAMPLES, endpoint=False)
        return bool(self.error_at(phase)[1].max() >= 1)

    def error_at(self, phase: NDArray[np.floating]) -> tuple[Waves, Waves]:
        """The error, rad, at measured phases, rad, and its derivative; both shaped as `phase`."""
        error, slope = np.zeros_like(phase), np.zeros_like(phase)
        turn = np.exp(1j * self.steps * phase)
        wave = np.ones_like(turn)
        for k, (cosine, sine) in enumerate(zip(self.cos, self.sin, strict=True), start=1):
            wave = wave * turn
            error += cosine * wave.real + sine * wave.imag
            slope += k * self.steps * (sine * wave.real - cosine * wave.imag)
        return error, slope


@dataclass(frozen=True, slots=True)
class Response:
    """A correction, how it was found, and in which capture.

    Attributes
    ----------
    way
        See `Way`.
    source
        Name of the capture, with its group.
    correction
        A curve, an exponent, or terms for one or more kinds of fringes.
    width, height
        The projector's image, px: what is found with one projector is none of another's.
    predistorted_by
        What had bent the patterns of that capture; None where they were plain.
    """

    way: Way
    source: str
    correction: GreyCurve | ImageExponent | tuple[PhaseTerms, ...]
    width: int
    height: int
    predistorted_by: str | None = None

    def elsewhere(self, width: int, height: int) -> str | None:
        """What to say where the projector's image has another size, px; None where it has not."""
        if (self.width, self.height) == (width, height):
            return None
        return (
            f"the response of {self.source} is of a projector of {self.width}x{self.height} px, "
            f"this one has {width}x{height}: measure it with this one"
        )

    @property
    def kind(self) -> str:
        """The correction in words."""
        match self.correction:
            case GreyCurve():
                return "curve of grey levels"
            case ImageExponent(exponent=exponent):
                return f"exponent {exponent:.3g} of the images"
            case _:
                return "phase terms"
