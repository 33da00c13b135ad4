from __future__ import annotations

import numpy as np
import pytest

from fringeworks.model import (
    CharucoTarget,
    CheckerboardTarget,
    CirclesTarget,
    Target,
    corners_at,
    expansion,
)

WARM = {"cte_per_k": 2e-5, "temperature_c": 20.0}
BOARDS: tuple[Target, ...] = (
    CheckerboardTarget(4, 3, 10.0, 12.0, **WARM),
    CharucoTarget(4, 3, 10.0, 12.0, 7.0, "DICT_4X4_50", **WARM),
    CirclesTarget(4, 3, 10.0, 12.0, 5.0, **WARM),
)


@pytest.mark.parametrize("board", BOARDS)
def test_points_run_row_by_row_and_grow_with_warmth(board: Target) -> None:
    points = board.corners_mm()
    assert points.shape == (board.corner_count, 3)
    np.testing.assert_array_equal(
        points[[0, 1, 4, 11]], [[0, 0, 0], [10, 0, 0], [0, 12, 0], [30, 24, 0]]
    )
    # 25 K more: 1 + 2e-5 x 25 = 1.0005.
    np.testing.assert_allclose(corners_at(board, 45.0), points * 1.0005, rtol=1e-12)
    np.testing.assert_allclose(corners_at(board, -5.0), points * 0.9995, rtol=1e-12)


def test_without_all_three_numbers_nothing_grows() -> None:
    assert expansion(BOARDS[0], None) == 1.0
    assert expansion(CheckerboardTarget(4, 3, 1.0, 1.0, cte_per_k=1e-5), 50.0) == 1.0
    assert expansion(CheckerboardTarget(4, 3, 1.0, 1.0, temperature_c=20.0), 50.0) == 1.0
