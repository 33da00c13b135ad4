"""Whether the scene stood still: between the sets, and within each of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from fringeworks.diagnose.frame_errors import FrameErrors
from fringeworks.diagnose.look import Look
from fringeworks.diagnose.suspicion import Suspicion
from fringeworks.model import Capture, FloatMap

LEAST_MOVE_PX = 0.12
"""Camera px by which the image must shift between two sets; on still scenes of the twin it is
0.02."""

LEAST_BY_SHIFT = 0.25
"""Of the difference at edges that the shift must explain; a curved response explains the rest."""

LEAST_SHIFTS = 0.5
"""Of a residual that shifts which change from frame to frame explain."""

MISFIT_SIGMAS, MISFIT_SHARE = 5.0, 0.12
"""A pixel fits no sinusoid whose residual is beyond both: sigma of the noise, and modulation."""

LEAST_MISFITS = 0.03
"""Of the lit pixels; JPEG's blocks alone reach 0.01 on fourstep-dome."""

LEAST_RAMP_RAD = 0.01
LARGEST_RAMP_RAD = 0.35
"""Shifts that are off by more are wrong ones."""

BLUR_PX = 1.0
REMEDY = (
    "Nothing may move from the first frame to the last: fix object, camera and projector, wait "
    "before the first frame, or capture faster with fewer frames."
)


def find_moves(capture: Capture, looks: Sequence[Look]) -> Iterator[Suspicion]:
    """By how much the mean images of the sets are shifted against each other."""
    views = [(look.where, look.offset) for look in looks if look.enough]
    white, black = capture.white(), capture.black()
    if white is not None and black is not None:
        views.append(("white and black", 0.5 * (white + black)))
    if len(views) < 2 or not looks:
        return
    first, most, shift = views[0], views[-1], np.zeros(2)
    for view in views[1:]:
        found = image_shift(first[1], view[1])
        if np.hypot(*found) > np.hypot(*shift):
            most, shift = view, found
    moved = float(np.hypot(*shift))
    if moved > LEAST_MOVE_PX:
        yield Suspicion(
            "motion",
            moved * _px_per_px(looks[0]),
            f"the scene moved by {moved:.2f} px in the camera's image between {first[0]} and "
            f"{most[0]}.",
            REMEDY,
            most[0],
            np.asarray(np.abs(most[1] - first[1]), np.float32),
            "grey levels by which the two mean images differ",
        )


def image_shift(first: FloatMap, second: FloatMap) -> NDArray[np.float64]:
    """``(x, y)`` px by which the second image is shifted, by least squares on its gradients.

    A gain between the two is solved for. Good to first order, for shifts of about a pixel.
    """
    import cv2

    one, other = (
        np.asarray(cv2.GaussianBlur(image.astype(np.float32), (0, 0), BLUR_PX), np.float64)
        for image in (first, second)
    )
    mean = 0.5 * (one + other)
    down, across = np.gradient(mean, axis=0), np.gradient(mean, axis=1)
    size = np.hypot(down, across)
    use = size > max(np.percentile(size, 90), 0.5)
    if np.count_nonzero(use) < 50:
        return np.zeros(2)
    design = np.column_stack([-across[use], -down[use], one[use], np.ones(np.count_nonzero(use))])
    solved, *_ = np.linalg.lstsq(design, (other - one)[use], rcond=None)
    left = (other - one)[use] - design @ solved
    kept = np.abs(left) <= 3 * np.median(np.abs(left)) + 1e-6
    design, change = design[kept], (other - one)[use][kept]
    solved, *_ = np.linalg.lstsq(design, change, rcond=None)
    alone, *_ = np.linalg.lstsq(design[:, 2:], change, rcond=None)
    with_shift = float(np.sum((change - design @ solved) ** 2))
    without = float(np.sum((change - design[:, 2:] @ alone) ** 2))
    explained = 1 - with_shift / max(without, 1e-9)
    return np.asarray(solved[:2]) if explained > LEAST_BY_SHIFT else np.zeros(2)


def _px_per_px(look: Look) -> float:
    """Projector px per camera px, by the phase's own steps."""
    axis = 1 if look.fringe.axis == "x" else 0
    steps = np.diff(look.phase, axis=axis)
    both = look.lit[:, 1:] & look.lit[:, :-1] if axis else look.lit[1:] & look.lit[:-1]
    turns = np.abs(np.angle(np.exp(1j * steps[both])))
    return float(np.median(turns)) * look.fringe.period_px / (2 * np.pi) if turns.size else 1.0


def find_unrest(looks: Sequence[Look], errors: Mapping[int, FrameErrors]) -> Iterator[Suspicion]:
    """Sets of four frames or more whose residual neither light nor response explains."""
    for look in looks:
        found = errors.get(look.place)
        if found is None:
            continue
        rest = _rms(look)
        least = np.maximum(MISFIT_SIGMAS * look.noise, MISFIT_SHARE * look.modulation)
        share = float(np.mean((rest > least)[look.lit]))
        steady = _ramp(found)
        if share > LEAST_MISFITS or steady:
            by_others = found.by_light + found.by_harmonic
            if not steady and by_others > 1 - LEAST_SHIFTS:
                continue
            loss = float(np.sqrt(np.mean((rest / look.modulation)[look.lit] ** 2)))
            rad = max(found.shifts_phase_rad if steady else 0.0, loss)
            yield Suspicion(
                "motion",
                rad * look.fringe.period_px / (2 * np.pi),
                f"{share:.0%} of the pixels of {look.name} fit no sinusoid"
                + (", as if the fringes ran on while they were taken." if steady else "."),
                REMEDY,
                look.where,
                rest,
                "grey levels that no sinusoid fits",
            )


def _ramp(found: FrameErrors) -> bool:
    """Whether the shifts are off by more and more, as they are where the surface moves."""
    wrong = found.shifts_rad
    spread = float(np.std(wrong))
    if spread < LEAST_RAMP_RAD or found.by_shifts < LEAST_SHIFTS:
        return False
    return spread < LARGEST_RAMP_RAD


def _rms(look: Look) -> FloatMap:
    """Residual per degree of freedom, NaN where no fringes are seen."""
    freedom = look.fringe.frame_count - 3
    rest = np.sqrt(np.sum(look.residual() ** 2, axis=0) / freedom)
    return np.where(look.lit, rest, np.nan).astype(np.float32)
