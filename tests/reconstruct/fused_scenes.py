"""Captures that go from frames to cloud in one pass, and ways to change them."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np

from fringeworks.model import (
    Axis,
    Camera,
    Capture,
    Frames,
)
from fringeworks.model.sequence import Pattern
from fringeworks.patterns.presets import make_sequence
from fringeworks.twin.scenes import paper_rig, step_scene
from fringeworks.twin.simulate import simulate

WHOLE = paper_rig()
LENS = WHOLE.camera.lens
HALF = replace(LENS, fx=LENS.fx / 2, fy=LENS.fy / 2, cx=LENS.cx / 2, cy=LENS.cy / 2)
RIG = replace(WHOLE, camera=Camera(WHOLE.camera.width // 2, WHOLE.camera.height // 2, HALF))
"""The paper's, its camera binned."""

Change: TypeAlias = Callable[[Frames], Frames]


@functools.cache
def seen(kind: str, axis: Axis = "x") -> Capture:
    """A step with noise, shadows and edges, lit from one side."""
    options: dict[str, Any] = {
        "three steps": {"steps": 3, "periods_px": (18.0,), "code": "complementary"},
        "eight steps": {"steps": 8, "periods_px": (16.0,)},
        "plain code": {"steps": 4, "periods_px": (20.0,), "code": "gray"},
        "two periods": {"steps": 3, "periods_px": (64.0, 16.0), "code": "complementary"},
        "inverted": {"steps": 4, "periods_px": (16.0,), "code": "gray", "inverted": True},
        "frequencies": {},
    }[kind]
    preset: Any = "multi-frequency" if kind == "frequencies" else "measure"
    sequence = make_sequence(
        preset, width=RIG.projector.width, height=RIG.projector.height, axes=(axis,), **options
    )
    return simulate(step_scene(), RIG, sequence, rng=np.random.default_rng(3)).capture


def only(capture: Capture, *kinds: type[Pattern]) -> Capture:
    """The capture with sets of these kinds alone."""
    sets = capture.sequence.sets
    kept = [n for n, item in enumerate(sets) if isinstance(item.pattern, kinds)]
    return replace(
        capture,
        sequence=replace(capture.sequence, sets=tuple(sets[n] for n in kept)),
        frames=tuple(capture.frames[n] for n in kept),
    )


def with_frames(capture: Capture, kind: type[Pattern], change: Change) -> Capture:
    """The capture with the frames of one kind of set changed."""
    frames = tuple(
        change(stack) if isinstance(item.pattern, kind) else stack for item, stack in capture
    )
    return replace(capture, frames=frames)


def deepened(stack: Frames) -> Frames:
    """Grey levels of 16 bits."""
    return np.uint16(257) * stack.astype(np.uint16)
