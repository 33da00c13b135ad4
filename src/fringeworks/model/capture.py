"""A capture: frames, the sequence that caused them, and what is known of the sensor."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import ShapeError
from fringeworks.model.exposures import compose_levels, extrapolate
from fringeworks.model.finding import Finding
from fringeworks.model.sequence import Colour, Pattern, PatternSet, Sequence

Frames: TypeAlias = NDArray[np.uint8] | NDArray[np.uint16]

P = TypeVar("P", bound=Pattern)

MAX_PIXELS = 89_478_485
"""Largest image that is read or simulated (Pillow's own limit against decompression bombs)."""

SATURATED_SHARE = 0.98
"""A grey level at or above this share of full scale counts as saturated."""


@dataclass(frozen=True, slots=True)
class Sensor:
    """The camera's grey levels: `full_scale` always; the noise where it was measured.

    `gain` is grey level of variance per grey level of signal (photon transfer), `read_noise`
    one standard deviation in grey levels. None means not known; without both of them the noise
    is estimated from images.
    """

    full_scale: float
    black_level: float = 0.0
    gain: float | None = None
    read_noise: float | None = None
    temperature_c: float | None = None

    @property
    def saturation(self) -> float:
        """Grey level from which a pixel counts as saturated."""
        return SATURATED_SHARE * self.full_scale

    @property
    def noise_is_known(self) -> bool:
        return self.gain is not None and self.read_noise is not None


@dataclass(frozen=True, slots=True)
class Capture:
    """Images of one scene, set by set.

    Attributes
    ----------
    sequence
        What was projected.
    frames
        One stack ``(n, H, W)`` of grey levels per set of the sequence, ``n`` its `image_count`;
        ``(n, H, W, 3)``, RGB, for a `Colour` set that the camera saw in colour.
    sensor
        Full scale and, where known, noise.
    colour
        ``(H, W, 3)`` RGB of the white set's first image where the camera saw colour, else None.
    dark_colour
        The same of the black set.
    name
        What the user calls it: the folder's name.
    findings
        What the reader noticed and the user should know.
    """

    sequence: Sequence
    frames: tuple[Frames, ...]
    sensor: Sensor
    colour: Frames | None = None
    dark_colour: Frames | None = None
    name: str = "capture"
    findings: tuple[Finding, ...] = ()
    provenance: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if len(self.frames) != len(self.sequence.sets):
            raise ShapeError(
                f"frames must hold one stack per set, {len(self.sequence.sets)}, "
                f"got {len(self.frames)}"
            )
        for stack, pattern_set in zip(self.frames, self.sequence.sets, strict=True):
            expected = (pattern_set.image_count, *self.shape)
            in_colour = isinstance(pattern_set.pattern, Colour) and stack.ndim == 4
            if stack.shape != ((*expected, 3) if in_colour else expected):
                raise ShapeError(f"a stack of frames must be {expected}, got {stack.shape}")

    @property
    def shape(self) -> tuple[int, int]:
        """(H, W) of the camera image."""
        height, width = self.frames[0].shape[1:3]
        return height, width

    def __iter__(self) -> Iterator[tuple[PatternSet, Frames]]:
        return iter(zip(self.sequence.sets, self.frames, strict=True))

    def select(self, group: str | None = None) -> Capture:
        """The capture with only the sets of `group` (None: the first group there is)."""
        chosen = self.sequence.choose_group(group)
        sets = tuple(self.sequence.sets[i] for i in chosen)
        return replace(
            self,
            sequence=Sequence(self.sequence.width, self.sequence.height, sets),
            frames=tuple(self.frames[i] for i in chosen),
            colour=self.colour if self.sequence.white_set in chosen else None,
            dark_colour=self.dark_colour if self.sequence.black_set in chosen else None,
        )

    def at_exposure(self, exposure_ms: float | None) -> Capture:
        """Only the sets of this exposure; all of them where nothing is shown at several."""
        if self.sequence.reference_ms is None:
            return self
        places = [
            place
            for place, item in enumerate(self.sequence.sets)
            if item.exposure_ms == exposure_ms
        ]
        sets = tuple(self.sequence.sets[place] for place in places)
        return replace(
            self,
            sequence=replace(self.sequence, sets=sets),
            frames=tuple(self.frames[place] for place in places),
        )

    def white(self) -> NDArray[np.float32] | None:
        """Mean ``(H, W)`` of the brightest uniform set above half of full scale, else None."""
        index = self.sequence.white_set
        return None if index is None else self.level_of(self.sequence.sets[index].pattern)

    def black(self) -> NDArray[np.float32] | None:
        """Mean ``(H, W)`` of the darkest uniform set below half of full scale, else None."""
        index = self.sequence.black_set
        return None if index is None else self.level_of(self.sequence.sets[index].pattern)

    def level_of(self, pattern: Pattern) -> NDArray[np.float32]:
        """Mean ``(H, W)`` of a pattern's first set; of all, where it is shown at several exposures.

        Grey levels are then those of the longest exposure (`Sequence.reference_ms`), and may be
        above full scale.
        """
        exposed, reference_ms = self._exposed(pattern), self.sequence.reference_ms
        if reference_ms is not None and exposed:
            return compose_levels(
                exposed,
                black_level=self.sensor.black_level,
                saturation=self.sensor.saturation,
                reference_ms=reference_ms,
            )
        stack = next(stack for item, stack in self if item.pattern == pattern)
        alone = len(stack) == 1  # needs no summing
        mean = stack[0].astype(np.float32) if alone else stack.mean(axis=0, dtype=np.float32)
        return np.asarray(mean)

    def saturation_of(self, pattern: Pattern) -> float:
        """Grey level from which `level_of` of this pattern counts as saturated."""
        exposed, reference_ms = self._exposed(pattern), self.sequence.reference_ms
        if reference_ms is None or not exposed:
            return self.sensor.saturation
        ratio = reference_ms / min(exposure_ms for exposure_ms, _ in exposed)
        return float(extrapolate(self.sensor.saturation, ratio, self.sensor.black_level))

    def _exposed(self, pattern: Pattern) -> list[tuple[float, Frames]]:
        """Exposure, ms, and frames of each set of a pattern that says its exposure."""
        return [
            (item.exposure_ms, stack)
            for item, stack in self
            if item.pattern == pattern and item.exposure_ms is not None
        ]

    def find(self, kind: type[P]) -> list[tuple[P, Frames, int]]:
        """Patterns of this kind, each with its frames and how often every frame is repeated."""
        return [
            (item.pattern, stack, item.repeats)
            for item, stack in self
            if isinstance(item.pattern, kind)
        ]


def to_grey(image: Frames) -> Frames:
    """``(H, W)`` luma (ITU-R BT.601) of an ``(H, W, 3)`` RGB image; a grey one as it is."""
    if image.ndim == 2:
        return image
    import cv2

    return cast(Frames, cv2.cvtColor(image, cv2.COLOR_RGB2GRAY))
