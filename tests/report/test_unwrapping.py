"""Pictures of spatial unwrapping: all of them come about, whatever the phase."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fringeworks.phase.regions import find_regions
from fringeworks.phase.spatial import unwrap_spatial
from fringeworks.report.unwrapping import _cut_lines, draw_unwrapping, save_unwrapping
from tests.phase.unwrapping import CASES, SHAPE, as_wrapped


def test_three_pictures_are_written(tmp_path: Path) -> None:
    case = CASES["torn patch"](np.random.default_rng(0))
    paths = save_unwrapping(unwrap_spatial(as_wrapped(case.wrapped)), tmp_path)
    names = ["relative_x.png", "regions_x.png", "residues_x.png"]
    assert [path.name for path in paths] == names
    assert all(path.stat().st_size > 10_000 for path in paths)


@pytest.mark.parametrize("value", [0.5, np.nan])
def test_flat_and_void(value: float) -> None:
    figures = dict(draw_unwrapping(find_regions(as_wrapped(np.full(SHAPE, value)))))
    title = figures["residues_x"].axes[0].get_title(loc="left")
    assert title == "0 residues and their cuts, axis x"


def test_titles_say_how_it_went() -> None:
    case = CASES["torn patch"](np.random.default_rng(0))
    unwrapped = unwrap_spatial(as_wrapped(case.wrapped))
    figures = dict(draw_unwrapping(unwrapped))
    title = figures["relative_x"].axes[0].get_title(loc="left")
    assert f"{unwrapped.residues} residues" in title
    assert "cheapest links first" in title


def test_cuts_run_along_the_sides_of_pixels() -> None:
    marks = np.zeros((4, 5), np.uint8)
    marks[2, 3], marks[1, 1] = 1, 2  # the left side of (2, 3), the upper side of (1, 1)
    x, y = _cut_lines(marks)
    np.testing.assert_array_equal(x, [2.5, 2.5, np.nan, 0.5, 1.5, np.nan])
    np.testing.assert_array_equal(y, [1.5, 2.5, np.nan, 0.5, 0.5, np.nan])
