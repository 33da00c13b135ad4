"""Smoothing that leaves slopes alone, and where a surface goes on."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.surface import mark_steps, smooth_phase

V, X = np.mgrid[:30, :40].astype(np.float32)
PLANE = (0.05 * X + 0.02 * V).astype(np.float32)  # turns


def smoothed(at: NDArray[np.float32]) -> NDArray[np.float32]:
    turns = np.where(np.isfinite(at), np.floor(np.nan_to_num(at) + 0.5), 0).astype(np.int32)
    phase = ((at - turns) * 2 * np.pi).astype(np.float32)
    out = np.empty_like(phase)
    smooth_phase(phase, turns, 0.125, out)
    return out


def marks(at: NDArray[np.float32]) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    right, down = np.full(at.shape, 7, np.uint8), np.full(at.shape, 7, np.uint8)
    mark_steps(at, 0.1, right, down)
    return right, down


def test_a_plane_stays_with_holes_and_at_edges() -> None:
    at = PLANE.copy()
    at[np.random.default_rng(0).random(at.shape) < 0.3] = np.nan
    np.testing.assert_allclose(smoothed(at), at, atol=2e-6)  # single precision of 2.6 turns


def test_noise_falls_by_the_root_of_thirteen() -> None:
    noise = np.random.default_rng(0).normal(0, 0.01, PLANE.shape).astype(np.float32)
    left = (smoothed(PLANE + noise) - PLANE)[2:-2, 2:-2]
    # 936 correlated values: about 72 independent ones, 5 sigma of sigma are 40 %.
    assert np.std(left) < 1.4 * 0.01 / np.sqrt(13)


def test_a_jump_is_not_smeared() -> None:
    at = PLANE + np.where(X >= 20, np.float32(0.4), np.float32(0))
    np.testing.assert_allclose(smoothed(at), at, atol=2e-6)


def test_marks_of_a_plane_and_of_a_jump() -> None:
    right, down = marks(PLANE)
    assert right[:, 1:].all()
    assert down[1:].all()
    assert not right[:, 0].any()
    assert not down[0].any()
    # The steps beside a jump of 0.15 depart from their neighbours' mean by 0.075, the jump by 0.15.
    right, down = marks(PLANE + np.where(X >= 20, np.float32(0.15), np.float32(0)))
    assert not right[:, 20].any()
    assert right[:, [*range(1, 20), *range(21, 40)]].all()
    assert down[1:].all()
    right, down = marks(PLANE + np.where(V >= 9, np.float32(0.15), np.float32(0)))
    assert not down[9].any()
    assert down[[*range(1, 9), *range(10, 30)]].all()
    assert right[:, 1:].all()


def test_nothing_goes_on_across_a_hole() -> None:
    at = PLANE.copy()
    at[10, 10] = np.nan
    right, down = marks(at)
    assert right[10, 10] == right[10, 11] == down[10, 10] == down[11, 10] == 0
    assert right[10, 9] == right[10, 12] == 1
