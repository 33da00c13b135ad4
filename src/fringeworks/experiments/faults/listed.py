"""Faults of the list: frames, bits, axes or rig are not what is said of them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from fringeworks.experiments.faults.base import (
    Case,
    Strength,
    boxes,
    find_set,
    good,
    half_rig,
    shoot,
    steps_of,
    with_set,
)
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.model import AXES, Fringe, GrayCode, Pose


def frames_swapped(strength: Strength, seed: int) -> Case:
    """Two neighbours exchanged."""
    capture = good(strength, seed)
    axis = AXES[seed % 2]
    place_ = find_set(capture, Fringe, axis)
    stack = capture.frames[place_].copy()
    one = seed % (len(stack) - 1)
    stack[[one, one + 1]] = stack[[one + 1, one]]
    return Case(with_set(capture, place_, stack), half_rig(), "frame order")


def frames_reversed(strength: Strength, seed: int) -> Case:
    """A set backwards."""
    capture = good(strength, seed)
    place_ = find_set(capture, Fringe, AXES[seed % 2])
    return Case(with_set(capture, place_, capture.frames[place_][::-1]), half_rig(), "frame order")


def frames_rotated(strength: Strength, seed: int) -> Case:
    """A set that begins in its middle."""
    capture = good(strength, seed)
    place_ = find_set(capture, Fringe, AXES[seed % 2])
    stack = capture.frames[place_]
    count = len(stack) // 2 if strength else 1
    return Case(with_set(capture, place_, np.roll(stack, count, axis=0)), half_rig(), "frame order")


def other_shifts(strength: Strength, seed: int) -> Case:
    """Other steps are listed than were shown."""
    capture = good((1, 2, 2)[strength], seed)
    parts = (5, 12, 10)[strength]
    place_ = find_set(capture, Fringe, AXES[seed % 2])
    sets = list(capture.sequence.sets)
    fringe: Any = sets[place_].pattern
    first = fringe.shifts_rad[0]
    sign = np.sign(np.sin(fringe.shifts_rad[1] - first))
    shifts = tuple(first + sign * 2 * np.pi * n / parts for n in range(fringe.frame_count))
    sets[place_] = replace(sets[place_], pattern=replace(fringe, shifts_rad=shifts))
    sequence = replace(capture.sequence, sets=tuple(sets))
    return Case(replace(capture, sequence=sequence), half_rig(), "wrong shifts")


def frame_repeated(strength: Strength, seed: int) -> Case:
    """The camera gave the image before once more."""
    capture = good(strength, seed)
    again = shoot(steps_of(strength), seed + 1000, scene=boxes(seed))
    place_ = find_set(capture, Fringe, AXES[seed % 2])
    stack = capture.frames[place_].copy()
    one = seed % (len(stack) - 1)
    stack[one + 1] = again.frames[place_][one] if strength else stack[one]
    return Case(with_set(capture, place_, stack), half_rig(), "repeated frame")


def frame_missing(strength: Strength, seed: int) -> Case:
    """One image was dropped, and every later one is listed a place too early."""
    capture = good(2 - strength, seed)
    flat = np.concatenate(list(capture.frames))
    ends = np.cumsum([len(stack) for stack in capture.frames])
    last = int(ends[find_set(capture, Fringe, "y")]) - 1
    gone = 1 + seed % (last - 1)
    left = np.concatenate([flat[:gone], flat[gone + 1 :], flat[-1:]])
    frames = tuple(np.split(left, ends[:-1]))
    return Case(replace(capture, frames=frames), half_rig(), "missing frame")


def bits_swapped(strength: Strength, seed: int) -> Case:
    """Two bits of a Gray code exchanged, or all of them."""
    capture = good(seed % 3, seed)
    place_ = find_set(capture, GrayCode, AXES[seed % 2])
    stack = capture.frames[place_].copy()
    code: Any = capture.sequence.sets[place_].pattern
    if strength == 2:
        stack[: code.bits] = stack[: code.bits][::-1]
    else:
        one = code.bits - 2 - strength
        stack[[one, one + 1]] = stack[[one + 1, one]]
    return Case(with_set(capture, place_, stack), half_rig(), "bit order")


def bit_inverted(strength: Strength, seed: int) -> Case:
    """One bit with light and dark exchanged."""
    capture = good(seed % 3, seed)
    place_ = find_set(capture, GrayCode, AXES[seed % 2])
    stack = capture.frames[place_].copy()
    white, black = capture.white(), capture.black()
    assert white is not None
    assert black is not None
    bit = 1 + strength
    stack[bit] = np.clip(np.rint(white + black - stack[bit]), 0, 255)
    return Case(with_set(capture, place_, stack), half_rig(), "inverted bit")


def rig_moved(strength: Strength, seed: int) -> Case:
    """The camera was turned after the calibration."""
    capture = good(seed % 3, seed)
    rig = half_rig()
    angle = np.deg2rad((0.1, 0.2, 0.5)[strength])
    turned = Pose(rotation_matrix(np.array([angle, 0.0, 0.3 * angle])), np.zeros(3))
    pose = rig.projector_from_camera
    moved = Pose(turned.rotation @ pose.rotation, turned.rotation @ pose.translation_mm)
    return Case(capture, replace(rig, projector_from_camera=moved), "epipolar")


def camera_flipped(strength: Strength, seed: int) -> Case:
    """Images mirrored on their way from the camera."""
    capture = good(seed % 3, seed)
    flips = (
        lambda stack: stack[..., ::-1],
        lambda stack: stack[:, ::-1],
        lambda stack: stack[:, ::-1, ::-1],
    )
    frames = tuple(np.ascontiguousarray(flips[strength](stack)) for stack in capture.frames)
    return Case(replace(capture, frames=frames), half_rig(), "mirrored")


def axes_exchanged(strength: Strength, seed: int) -> Case:
    """The sets of either axis are listed as those of the other."""
    capture = good(strength, seed)
    other = dict(zip(AXES, AXES[::-1], strict=True))
    sets = tuple(
        replace(item, pattern=replace(item.pattern, axis=other[item.pattern.axis]))
        if isinstance(item.pattern, Fringe | GrayCode)
        else item
        for item in capture.sequence.sets
    )
    sequence = replace(capture.sequence, sets=sets)
    return Case(replace(capture, sequence=sequence), half_rig(), "axes swapped")
