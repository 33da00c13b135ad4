"""A capture: frames, the sequence that caused them, and what is known of the sensor."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import ShapeError
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

    def white(self) -> NDArray[np.float32] | None:
        """Mean ``(H, W)`` of the brightest uniform set above half of full scale, else None."""
        return self._mean_of(self.sequence.white_set)

    def black(self) -> NDArray[np.float32] | None:
        """Mean ``(H, W)`` of the darkest uniform set below half of full scale, else None."""
        return self._mean_of(self.sequence.black_set)

    def _mean_of(self, index: int | None) -> NDArray[np.float32] | None:
        if index is None:
            return None
        stack = self.frames[index]
        alone = len(stack) == 1  # needs no summing
        mean = stack[0].astype(np.float32) if alone else stack.mean(axis=0, dtype=np.float32)
        return np.asarray(mean)

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
