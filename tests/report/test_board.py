from __future__ import annotations

import io
import re
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.calibrate.boards.corners import find_board
from fringeworks.errors import UsageError
from fringeworks.model import CharucoTarget, CheckerboardTarget, CirclesTarget, Target
from fringeworks.report.board import Paper, place_target, target_figure, write_page

CARD = Paper(127.0, 101.6, "card")  # 5 x 4 inches
A4 = Paper(210.0, 297.0, "a4")
DPI = 300
PX_PER_MM = DPI / 25.4
BOARDS: tuple[Target, ...] = (
    CheckerboardTarget(6, 4, 12.0, 12.0),
    CharucoTarget(6, 4, 12.0, 12.0, 8.0, "DICT_4X4_50"),
    CirclesTarget(6, 4, 12.0, 12.0, 6.0),
)


def page(target: Target) -> NDArray[np.uint8]:
    """The page as a printer of 300 dpi would have it, without a margin of its own."""
    buffer = io.BytesIO()
    target_figure(target, CARD).savefig(buffer, format="png", dpi=DPI)
    data = np.frombuffer(buffer.getvalue(), np.uint8)
    image = cv2.imdecode(data, cv2.IMREAD_GRAYSCALE)
    assert image is not None
    return np.asarray(image, dtype=np.uint8)


@pytest.mark.parametrize("target", BOARDS, ids=lambda target: type(target).__name__)
def test_the_print_is_true(target: Target) -> None:
    """Read back at 300 dpi: each pitch right to 1e-3, the first corner where `place` says."""
    image = page(target)
    assert image.shape == (1200, 1500)
    place = place_target(target, CARD)
    found = find_board(image, target)
    expected = target.corners_mm()[:, :2] + [place.left_mm, place.top_mm]
    pixels = min(
        found.pixels, found.pixels[::-1], key=lambda p: abs(p[0, 0] - expected[0, 0] * PX_PER_MM)
    )
    # Pixel centres are whole numbers: the page's corner is at -1/2.
    np.testing.assert_allclose((pixels + 0.5) / PX_PER_MM, expected, atol=0.02)
    grid = pixels.reshape(target.rows, target.columns, 2) / PX_PER_MM
    assert np.diff(grid[..., 0], axis=1).mean() == pytest.approx(target.pitch_x_mm, rel=1e-3)
    assert np.diff(grid[..., 1], axis=0).mean() == pytest.approx(target.pitch_y_mm, rel=1e-3)


def test_the_bars_are_as_long_as_they_say() -> None:
    """From the middle of one mark to that of the other, along lines through the marks."""
    target = BOARDS[0]
    place, image = place_target(target, CARD), page(target)
    assert place.bars_mm == (50.0, 50.0)
    left, top = place.left_mm - place.before_mm, place.top_mm - place.before_mm
    row = round((top + place.high_mm + 3.0 + 0.5) * PX_PER_MM)  # above the bar, in its marks
    column = round((left + place.wide_mm + 3.0 + 0.5) * PX_PER_MM)
    for line in (
        image[row, : round((left + 55) * PX_PER_MM)],
        image[: round((top + 55) * PX_PER_MM), column],
    ):
        dark = 255.0 - np.asarray(line, dtype=np.float64)
        marks = [part for part in np.split(np.arange(len(line)), _gaps(dark)) if dark[part].any()]
        middles = [float(dark[part] @ part / dark[part].sum()) for part in marks]
        assert len(middles) == 2
        assert (middles[1] - middles[0]) / PX_PER_MM == pytest.approx(50.0, abs=0.05)


def _gaps(dark: NDArray[np.float64]) -> NDArray[np.intp]:
    """Where a run of white begins."""
    return np.flatnonzero((dark[1:] == 0) & (dark[:-1] > 0)) + 1


def test_pdf_has_the_papers_size_and_the_same_bytes(tmp_path: Path) -> None:
    target = CheckerboardTarget(11, 8, 20.0, 20.0)
    first = write_page(target_figure(target, A4), tmp_path / "a.pdf").read_bytes()
    second = write_page(target_figure(target, A4), tmp_path / "b.pdf").read_bytes()
    assert first == second
    box = re.search(rb"/MediaBox \[ 0 0 ([\d.]+) ([\d.]+) \]", first)
    assert box is not None
    size_mm = [float(side) / 72 * 25.4 for side in box.groups()]
    assert size_mm == pytest.approx([297.0, 210.0], abs=1e-3)  # turned: it fits across only
    assert b"/Subtype /Image" not in first


@pytest.mark.parametrize("target", BOARDS, ids=lambda target: type(target).__name__)
def test_print_and_bars_stay_inside_the_margins(target: Target) -> None:
    dark = page(target) < 128
    margin = int(6.0 * PX_PER_MM) - 1
    assert not dark[:margin].any()
    assert not dark[-margin:].any()
    assert not dark[:, :margin].any()
    assert not dark[:, -margin:].any()


def test_upright_where_that_fits() -> None:
    assert place_target(CheckerboardTarget(8, 11, 20.0, 20.0), A4).paper == A4
    assert place_target(CheckerboardTarget(3, 3, 20.0, 20.0), A4).paper == A4


@pytest.mark.parametrize("target", BOARDS, ids=lambda target: type(target).__name__)
def test_too_large_says_the_largest_that_fits(target: Target) -> None:
    large = replace(target, pitch_x_mm=60.0, pitch_y_mm=60.0)
    if isinstance(large, CirclesTarget):
        large = replace(large, diameter_mm=30.0)
    with pytest.raises(UsageError, match=r"do not fit a4 \(210 x 297 mm\)") as refusal:
        place_target(large, A4)
    found = re.search(r"at most ([\d.]+),", str(refusal.value))
    assert found is not None
    for pitch, fits in ((float(found[1]), True), (float(found[1]) + 0.1, False)):
        scaled = replace(large, pitch_x_mm=pitch, pitch_y_mm=pitch)
        if isinstance(scaled, CirclesTarget):
            scaled = replace(scaled, diameter_mm=pitch / 2)
        if fits:
            place_target(scaled, A4)
        else:
            with pytest.raises(UsageError, match="do not fit"):
                place_target(scaled, A4)
