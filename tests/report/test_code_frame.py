"""Pictures of what the paper's method reads; nothing to read has a picture too."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fringeworks.model import Codeword
from fringeworks.phase.decode import decode_phases
from fringeworks.phase.paper_code import read_code_frame
from fringeworks.report.code_frame import (
    MOST_REGIONS,
    draw_code_reading,
    save_code_reading,
    save_fringes_read,
)
from tests.phase.test_paper_code import Array, around, frames_of, islands


def drawn_of(u: Array, folder: Path) -> list[str]:
    paths = save_code_reading(read_code_frame(frames_of(u, window=around(u, 90.0))), folder)
    assert all(path.stat().st_size > 1000 for path in paths)
    return [path.stem for path in paths]


def test_two_islands(tmp_path: Path) -> None:
    names = ["code_frame_x", "code_fringes_x", "code_spectra_x"]
    assert drawn_of(islands((100.0, 200.0), (300.0, 400.0)), tmp_path) == names


def test_no_whole_fringe(tmp_path: Path) -> None:
    assert drawn_of(islands((101.0, 120.0)), tmp_path) == ["code_frame_x"]


def test_panels_say_what_was_found() -> None:
    """Orders 4 and 10 carry p5; letters go from left to right, the largest regions alone."""
    u = islands((104.0, 152.0), (300.0, 350.0), *[(200.0, 245.0)] * MOST_REGIONS)
    reading = read_code_frame(frames_of(u, window=around(u, 90.0)))
    assert len(reading.regions) > MOST_REGIONS
    figures = dict(draw_code_reading(reading))
    spectra = figures["code_spectra_x"].axes
    assert len(spectra) == MOST_REGIONS
    titles = [panel.get_title(loc="left") for panel in spectra]
    assert titles[0].startswith("A: 27.")
    assert titles[0].endswith("Hz, p5, order 4")
    assert titles[1].endswith("p5, order 10")
    crossings = figures["code_fringes_x"].axes[0].get_title(loc="left")
    assert crossings == "A: one fringe of 64.0 camera px"
    np.testing.assert_equal([title[0] for title in titles], list("ABCD"))


def test_a_decoded_capture(tmp_path: Path) -> None:
    """What `decode --orders NAME --figures` draws besides the maps; a window is not asked again."""
    u = islands((100.0, 150.0), (300.0, 350.0))
    frames = frames_of(u, code=Codeword("x", 32.0, tuple(np.geomspace(2.0, 16.0, 20))))
    decoding = decode_phases(frames.capture, orders="code-correlation")
    for orders, stems in (
        ("code-correlation", {"code_frame_x", "code_fringes_x", "code_spectra_x"}),
        ("code-frame", set()),
    ):
        drawn = save_fringes_read(frames.capture, decoding, tmp_path, orders=orders, volume=None)
        assert {path.stem for path in drawn} == stems
