"""Section 5 of the paper on the twin: Table 1, its example, its figures and its own check."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.experiments import code_frame
from fringeworks.experiments.code_frame import (
    IDEAL_OFFSET_HZ,
    TABLE_1,
    Printed,
    captured_hz,
    ideal_hz,
    make_figures,
    measure_codewords,
    score_method,
    see_template,
    twin_frames,
)
from fringeworks.phase.orders import AxisFrames, OrderMethod
from fringeworks.phase.paper_code import code_correlation, paper_code, read_code_frame
from fringeworks.twin.scenes import two_scene, wall_scene

ROWS = {row.period_px: row for row in TABLE_1}
PRINTED_DIGIT_HZ = 0.05


@pytest.mark.parametrize("row", TABLE_1, ids=lambda row: f"{row.period_px:g}")
class TestTable:
    def test_ideal_column_to_the_printed_digit(self, row: Printed) -> None:
        """3 px is printed as what it reads without the 0.5 of all the others."""
        offset = IDEAL_OFFSET_HZ if row.period_px == 3 else 0.0
        # 160 Hz over 4096 steps of the transform: read to 0.02
        assert ideal_hz(row.period_px) - offset == pytest.approx(
            row.ideal_hz, abs=PRINTED_DIGIT_HZ + 0.02
        )

    def test_captured_column_within_its_tolerance(self, row: Printed) -> None:
        assert captured_hz(row.period_px) == pytest.approx(
            row.captured_hz, abs=row.tolerance_hz + 1e-9
        )


def test_the_second_row_is_not_what_the_paper_prints() -> None:
    assert ideal_hz(3.0) == pytest.approx(53.74, abs=0.02)


def test_captured_column_on_the_twin() -> None:
    """A wall over the whole view shows all codewords; every median is `160 / p + 1`.

    A box of 62 px displaces a peak by its mirror image and by the slope of the light, up to a
    tenth of a cycle per fringe: half a Hz.
    """
    frames, column = twin_frames(wall_scene())
    seen = measure_codewords(frames, column)
    assert set(seen) == set(ROWS)
    for word, found in seen.items():
        assert found.fringes > 400
        assert found.right == 1.0
        assert found.median_hz == pytest.approx(captured_hz(word), abs=0.5)


@pytest.fixture(scope="module")
def two() -> tuple[AxisFrames, NDArray[np.float64]]:
    frames, column = twin_frames(two_scene())
    return replace(frames, window=see_template(seed=1)), column


def test_the_paper_s_example(two: tuple[AxisFrames, NDArray[np.float64]]) -> None:
    """Cylinder at about 54 Hz, which is p2, cone p1: their orders differ by five."""
    cylinder, cone = sorted(read_code_frame(two[0]).regions, key=lambda r: r.period.pixel[1])
    assert (cylinder.codeword, cone.codeword) == (1, 0)
    assert cylinder.order is not None
    assert cone.order is not None
    assert cone.order - cylinder.order == 5


@pytest.mark.parametrize("method", [paper_code, code_correlation])
def test_absolute_phase_is_gray_code_s(
    method: OrderMethod, two: tuple[AxisFrames, NDArray[np.float64]]
) -> None:
    score = score_method(method, *two)
    assert score.ordered > 0.97
    assert (score.wrong, score.differs) == (0.0, 0.0)


def test_a_spectrum_of_shaded_code_fails_where_the_sequence_would_not(
    two: tuple[AxisFrames, NDArray[np.float64]],
) -> None:
    """On round objects shading outdoes the finest codeword: the paper's point must be well set."""
    seen = measure_codewords(*two)
    assert seen[2.0].right < 0.5
    assert seen[3.0].right > 0.9


def test_figures(
    two: tuple[AxisFrames, NDArray[np.float64]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    window = two[0].window
    assert window is not None
    monkeypatch.setattr(code_frame, "twin_frames", lambda scene, seed: two)
    monkeypatch.setattr(code_frame, "see_template", lambda seed: window)
    paths = make_figures(tmp_path)
    assert [path.name for path in paths] == [
        "code_pattern.png",
        "code_profile.png",
        "code_frame_x.png",
        "code_fringes_x.png",
        "code_spectra_x.png",
    ]
    assert all(path.stat().st_size > 5000 for path in paths)
