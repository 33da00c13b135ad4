"""Captures that are not usual: of one kind of set, of one value, tiny, deep, in groups."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fringeworks.diagnose import check_capture
from fringeworks.diagnose.look import look_at
from fringeworks.errors import ShapeError, UsageError
from fringeworks.experiments.faults import good, half_rig
from fringeworks.experiments.faults.base import eight_steps, shoot
from fringeworks.model import (
    Capture,
    Codeword,
    Colour,
    Fringe,
    GrayCode,
    Pattern,
    PatternSet,
    Sensor,
    Sequence,
    Uniform,
)
from fringeworks.patterns import make_sequence, probe_sequence, render_sequence
from fringeworks.twin.scenes import named_scene, paper_rig

WIDTH, HEIGHT = 128, 96


def drawn(**kinds: Any) -> Capture:
    """A camera that sees the projector's image itself, in its grey levels from 20 to 220."""
    asked = {"periods_px": (16.0,), "codewords_px": (), **kinds}
    sequence = make_sequence("paper", width=WIDTH, height=HEIGHT, **asked)
    rng = np.random.default_rng(5)
    stacks: list[Any] = []
    for _, stack in render_sequence(sequence):
        light = 20 + 200 * np.asarray(stack, np.float64) / 255
        stacks.append(np.rint(light + rng.normal(0, 1, light.shape)).astype(np.uint8))
    return Capture(sequence, tuple(stacks), Sensor(255.0))


def only(capture: Capture, wanted: Callable[[Pattern], bool]) -> Capture:
    kept = [n for n, item in enumerate(capture.sequence.sets) if wanted(item.pattern)]
    sets = tuple(capture.sequence.sets[n] for n in kept)
    frames = tuple(capture.frames[n] for n in kept)
    return replace(capture, sequence=replace(capture.sequence, sets=sets), frames=frames)


def names(capture: Capture) -> list[str]:
    return [finding.name for finding in check_capture(capture).findings]


@pytest.mark.parametrize(
    "wanted",
    [
        lambda pattern: getattr(pattern, "axis", "x") == "x",
        lambda pattern: not isinstance(pattern, Fringe),
        lambda pattern: isinstance(pattern, Fringe),
        lambda pattern: not isinstance(pattern, GrayCode),
        lambda pattern: isinstance(pattern, Uniform),
    ],
    ids=["one axis", "Gray alone", "fringes alone", "no code", "white and black"],
)
@pytest.mark.parametrize("steps", [3, 4])
def test_a_part_of_a_good_capture_is_clean(wanted: Callable[[Pattern], bool], steps: int) -> None:
    assert names(only(drawn(steps=steps), wanted)) == []


@pytest.mark.parametrize("code", ["gray", "staircase"])
def test_other_codes_are_clean(code: str) -> None:
    assert names(drawn(code=code)) == []


def test_a_code_frame_without_a_rig_is_no_fault_but_is_told() -> None:
    capture = drawn(code="none", codewords_px="paper", periods_px=(32.0,))
    assert capture.find(Codeword)
    found = check_capture(capture)

    assert found.findings == ()
    assert any("code frame" in reason for reason in found.unseen)


@pytest.mark.parametrize(
    ("level", "name"), [(0, "too dark"), (100, "too dark"), (255, "saturation")]
)
def test_images_of_one_value(level: int, name: str) -> None:
    capture = drawn()
    flat = tuple(np.full_like(stack, level) for stack in capture.frames)
    found = check_capture(replace(capture, frames=flat))

    assert [finding.name for finding in found.findings] == [name]
    # No pixel is known but to a period alone.
    assert found.findings[0].cost == pytest.approx(16 / np.sqrt(12), rel=1)


@pytest.mark.parametrize("shape", [(1, 1), (1, 100), (90, 2), (12, 12), (40, 50)])
def test_tiny_images_tell_nothing_rather_than_something_wrong(shape: tuple[int, int]) -> None:
    capture = drawn()
    cut: list[Any] = [s[:, : shape[0], : shape[1]].copy() for s in capture.frames]
    assert names(replace(capture, frames=tuple(cut))) == []


@pytest.mark.parametrize(("factor", "full_scale"), [(16, 4095.0), (257, 65535.0)])
def test_noise_is_the_same_share_of_more_bits(factor: int, full_scale: float) -> None:
    """A deeper image of the same light: sixteenths of 16 bits once ran over."""
    capture = drawn()
    deep = tuple(stack.astype(np.uint16) * np.uint16(factor) for stack in capture.frames)
    noise = look_at(capture)[0].noise
    deeper = look_at(replace(capture, frames=deep, sensor=Sensor(full_scale)))[0].noise

    assert noise == pytest.approx(1.0, rel=0.1)  # what was drawn, with the rounding
    assert deeper / factor == pytest.approx(noise, rel=0.1)  # its own rounding
    assert names(replace(capture, frames=deep, sensor=Sensor(full_scale))) == []


def test_a_rig_of_another_size_is_refused() -> None:
    with pytest.raises(ShapeError, match="752x480 like the rig's camera"):
        check_capture(good(0, 2), paper_rig())


def test_a_gray_code_without_white_cannot_be_decoded_and_that_is_told() -> None:
    found = check_capture(only(drawn(), lambda pattern: isinstance(pattern, GrayCode)))

    assert [finding.name for finding in found.findings] == ["not decodable"]
    assert "nothing can be decoded" in found.findings[0].message


def test_a_colour_frame_that_was_seen_in_grey_cannot_be_decoded() -> None:
    capture = drawn(code="colour")
    assert capture.find(Colour)
    assert names(capture) == ["not decodable"]


def test_of_two_exposures_neither_is_too_long_nor_too_short() -> None:
    """The long one is clipped, the short one faint: each for the other's sake."""
    capture = only(drawn(), lambda pattern: isinstance(pattern, Fringe))
    sets: list[PatternSet] = []
    frames: list[Any] = []
    for exposure_ms, gain in ((5.0, 0.15), (20.0, 2.0)):
        for item, stack in capture:
            sets.append(replace(item, exposure_ms=exposure_ms))
            frames.append(np.clip(np.rint(stack * gain), 0, 255).astype(np.uint8))
    both = Capture(Sequence(WIDTH, HEIGHT, tuple(sets)), tuple(frames), capture.sensor)
    halves = [
        replace(both, sequence=replace(both.sequence, sets=tuple(part)), frames=tuple(stacks))
        for part, stacks in ((sets[:2], frames[:2]), (sets[2:], frames[2:]))
    ]

    assert [names(half)[0] for half in halves] == ["too dark", "saturation"]
    assert not {"too dark", "saturation"} & set(names(both))


def test_groups_are_checked_one_at_a_time() -> None:
    capture = drawn()
    black = tuple(np.zeros_like(stack) for stack in capture.frames)
    sets = tuple(
        replace(item, group=group) for group in ("lit", "dark") for item in capture.sequence.sets
    )
    sequence = replace(capture.sequence, sets=sets)
    both = replace(capture, sequence=sequence, frames=capture.frames + black)

    assert check_capture(both).findings == ()
    assert [one.name for one in check_capture(both, group="dark").findings] == ["too dark"]
    with pytest.raises(UsageError, match="lit, dark"):
        check_capture(both, group="bright")


def test_what_could_not_be_looked_for_is_said() -> None:
    three = check_capture(good(0, 2), half_rig())
    four = check_capture(good(1, 2), half_rig())

    assert [reason.split(":")[0] for reason in three.unseen] == [
        "motion and wrong shifts inside a set of three frames"
    ]
    assert four.unseen == ()


def test_bright_things_before_a_void_are_not_dark() -> None:
    """The balls fill a twentieth of the image: its brightest twentieth has their dim rims."""
    capture = shoot(eight_steps(), 3, scene=named_scene("balls"))
    assert np.mean([look.lit.mean() for look in look_at(capture)]) < 0.06
    assert names(capture) == []


def test_frames_of_the_test_preset_are_no_fault() -> None:
    """Their grey stripes tell no orders, and no colour camera is asked for."""
    assert names(shoot(probe_sequence(width=304, height=342), 1)) == []
