"""What all pictures share."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from matplotlib.figure import Figure

from fringeworks.errors import FormatError
from fringeworks.report.canvas import (
    VOID_COLOUR,
    Shade,
    map_figure,
    new_figure,
    robust_limits,
    save_figure,
)

NAN = float("nan")


def pixels(path: Path) -> np.ndarray[tuple[int, ...], np.dtype[np.uint8]]:
    """``(H, W, 3)`` RGB of a picture."""
    image = cv2.imread(str(path))
    assert image is not None
    return np.asarray(image[..., ::-1], dtype=np.uint8)


def share_of(
    rgb: np.ndarray[tuple[int, ...], np.dtype[np.uint8]], colour: tuple[int, ...]
) -> float:
    return float(np.mean(np.abs(rgb.astype(int) - colour).max(axis=-1) <= 2))


def test_wild_values_do_not_decide_the_colours() -> None:
    values = np.linspace(0, 100, 1001)
    values[0], values[1], values[2] = 1e9, -1e9, NAN
    low, high = robust_limits(values)
    assert 0 < low < 3
    assert 97 < high < 101


@pytest.mark.parametrize("values", [[NAN, NAN], [5.0, 5.0], []])
def test_limits_stay_apart_where_there_is_no_range(values: list[float]) -> None:
    low, high = robust_limits(np.array(values))
    assert low < high


@pytest.mark.parametrize("colours", ["viridis", "viridis_r", "cividis", "plasma", "twilight"])
def test_no_value_looks_like_void(colours: str) -> None:
    shades = Shade("rad", colours).colormap(np.linspace(0, 1, 256))[:, :3]
    assert np.abs(shades - float(VOID_COLOUR)).max(axis=1).min() > 0.15


def test_void_is_light_grey(tmp_path: Path) -> None:
    values = np.tile(np.linspace(0, 1, 60), (40, 1))
    void = values.copy()
    void[:20] = NAN
    full = save_figure(map_figure(values, Shade("px"), "full"), tmp_path / "full.png")
    half = save_figure(map_figure(void, Shade("px"), "half"), tmp_path / "half.png")
    grey = (230, 230, 230)
    assert share_of(pixels(full), grey) < 0.005
    assert share_of(pixels(half), grey) > 0.25


def test_across_a_wrap_no_third_phase_appears(tmp_path: Path) -> None:
    """Fine fringes are averaged as colours: the mean of pi and -pi is no phase of zero."""
    values = np.tile([np.pi, -np.pi], (2000, 1500)).astype(np.float32)
    shade = Shade("rad", "twilight", (-np.pi, np.pi))
    rgb = pixels(save_figure(map_figure(values, shade, "wrap"), tmp_path / "wrap.png"))
    middle = rgb[rgb.shape[0] // 4 : rgb.shape[0] // 2, rgb.shape[1] // 4 : rgb.shape[1] // 2]
    assert middle.min() > 150


@pytest.mark.parametrize("shape", [(512, 658), (1216, 1936), (600, 200)])
def test_no_label_is_cut_off(shape: tuple[int, int], tmp_path: Path) -> None:
    values = np.broadcast_to(np.linspace(0, 1e-3, shape[1]), shape)
    shade = Shade("a rather long label of what this is, grey levels")
    rgb = pixels(save_figure(map_figure(values, shade, "title"), tmp_path / "map.png"))
    frame = [rgb[:6], rgb[-6:], rgb[:, :6], rgb[:, -6:]]
    assert all((side == 255).all() for side in frame)


def test_a_picture_is_whole_or_not_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = save_figure(new_figure(2.0), tmp_path / "deep" / "old.png")
    before = path.read_bytes()

    def fail(self: Figure, target: Path, **_: object) -> None:
        target.write_bytes(b"half")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Figure, "savefig", fail)
    with pytest.raises(FormatError, match=r"old\.png: cannot be written \(No space left"):
        save_figure(new_figure(2.0), path)
    assert path.read_bytes() == before
    assert list(path.parent.iterdir()) == [path]


def test_no_global_state_of_pyplot_is_touched() -> None:
    code = (
        "import sys, fringeworks.report.cloud, fringeworks.report.decoding\n"
        "import fringeworks.report.calibration\n"
        "print('matplotlib.pyplot' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"
