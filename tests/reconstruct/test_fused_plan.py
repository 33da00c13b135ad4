"""What does not go from frames to cloud in one pass."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fringeworks.model import (
    Capture,
    Fringe,
    GrayCode,
    Rig,
    Uniform,
)
from fringeworks.pipeline import scan
from fringeworks.reconstruct.full import CloudRules
from fringeworks.reconstruct.fused_plan import prepare_scan
from tests.reconstruct.fused_scenes import RIG, deepened, only, seen, with_frames

OTHER_WAYS = (
    "exact",
    "another axis",
    "no depth range",
    "another projector",
    "another method",
    "no code to read",
    "inverted bits",
    "beats",
    "repeated bits",
    "types",
    "a code alone",
    "fringes alone",
)


def other_ways() -> dict[str, tuple[Capture, Rig, dict[str, Any]]]:
    """Whatever needs one thing that the kernel does not know."""
    capture = seen("three steps")
    narrow = replace(RIG, projector=replace(RIG.projector, width=600))
    code = capture.sequence.sets[1]
    twice = replace(code, repeats=2)
    repeated = replace(
        capture,
        sequence=replace(
            capture.sequence,
            sets=tuple(twice if item is code else item for item in capture.sequence.sets),
        ),
        frames=(capture.frames[0], capture.frames[1].repeat(2, axis=0), *capture.frames[2:]),
    )
    mixed = with_frames(capture, GrayCode, deepened)
    exact, along_y = CloudRules(exact=True), CloudRules(axis="y")
    return {
        "exact": (capture, RIG, {"cloud_rules": exact}),
        "another axis": (capture, RIG, {"cloud_rules": along_y}),
        "no depth range": (capture, replace(RIG, volume_mm=None), {}),
        "another projector": (capture, narrow, {}),
        "another method": (capture, RIG, {"orders": "depth-window"}),
        "no code to read": (seen("frequencies"), RIG, {"orders": "gray"}),
        "inverted bits": (seen("inverted"), RIG, {}),
        "beats": (seen("two periods"), RIG, {}),
        "repeated bits": (repeated, RIG, {}),
        "types": (mixed, RIG, {}),
        "a code alone": (only(capture, GrayCode, Uniform), RIG, {}),
        "fringes alone": (only(capture, Fringe), RIG, {}),
    }


@pytest.mark.parametrize("name", OTHER_WAYS)
def test_what_goes_the_other_way(name: str) -> None:
    capture, rig, options = other_ways()[name]
    assert prepare_scan(capture, rig, **options) is None


def test_two_axes_go_the_other_way() -> None:
    """Each pixel has a coordinate too many then, see `full`."""
    first, second = only(seen("three steps"), Fringe, GrayCode), seen("three steps", "y")
    both = replace(
        first,
        sequence=replace(first.sequence, sets=(*first.sequence.sets, *second.sequence.sets)),
        frames=(*first.frames, *second.frames),
    )
    assert prepare_scan(both, RIG) is None
    assert np.isfinite(scan(both, RIG).epipolar_px).any()
