"""``preview``: figures, the image, the window."""

from __future__ import annotations

import json
import time
from pathlib import Path

import numpy as np
import pytest

from fringeworks.acquire.looking import look_at, paint
from fringeworks.cli import preview as command
from fringeworks.devices import Faults
from fringeworks.devices.viewer import Viewer, display_beside
from fringeworks.files import read_image, write_rig
from fringeworks.model import Sensor
from tests.cli.scenes import run
from tests.devices.screens import open_screens
from tests.devices.stages import HEIGHT, RIG, WIDTH, MirrorStage
from tests.devices.toys import install_toys

SENSOR = Sensor(255.0)


@pytest.fixture(autouse=True)
def no_desktop(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture
def station(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr("fringeworks.twin.stage.Stage", lambda *_: MirrorStage())
    write_rig(tmp_path / "rig.json", RIG)
    path = tmp_path / "station.toml"
    path.write_text(
        'format = "fringeworks-station/1"\n[projector]\nkind = "simulated"\n'
        '[camera]\nkind = "simulated"\nexposure_ms = 20\n'
        '[simulated]\nscene = "wall"\nrig = "rig.json"\n'
    )
    return path


def test_figures_of_an_image() -> None:
    image = np.full((20, 20), 100, np.uint8)
    assert look_at(image, SENSOR).focus == 0
    image[:5, :4] = 255
    look = look_at(image, SENSOR)
    assert look.saturated_share == 20 / 400
    assert look.mean == pytest.approx(107.75)
    assert (look.least, look.most) == (100, 255)
    colours = np.zeros((2, 2, 3), np.uint8)
    colours[0, 0, 2] = 255
    assert look_at(colours, SENSOR).saturated_share == 0.25
    assert look_at(colours * 0, SENSOR).focus == 0


def test_focus_is_largest_in_focus_and_no_matter_of_light() -> None:
    import cv2

    sharp = np.zeros((64, 64), np.uint8)
    sharp[:, ::8] = sharp[:, 1::8] = 200
    figures = [
        look_at(np.asarray(cv2.GaussianBlur(sharp, (0, 0), sd), np.uint8), SENSOR).focus
        for sd in (0.3, 0.8, 1.5, 3.0)
    ]
    assert figures == sorted(figures, reverse=True)
    assert look_at(sharp // 2, SENSOR).focus == pytest.approx(look_at(sharp, SENSOR).focus)


def test_saturated_pixels_are_red() -> None:
    image = np.array([[0, 512, 1023]], np.uint16)
    painted = paint(image, Sensor(1023.0))
    assert painted.tolist() == [[[0, 0, 0], [127, 127, 127], [255, 0, 0]]]


def test_white_saturates(station: Path, tmp_path: Path) -> None:
    told = run(
        "preview", "--station", station, "--frames", 3, "--out", tmp_path / "a.png", "--json"
    )
    assert told.exit_code == 0, told.stderr
    values = json.loads(told.stdout)
    assert (values["frames"], values["saturated_share"], values["mean"]) == (3, 1.0, 255)
    assert values["frames_per_s"] == pytest.approx(1 / 0.0333, rel=0.01)
    assert np.all(read_image(tmp_path / "a.png") == [255, 0, 0])


def test_words(station: Path) -> None:
    told = run("preview", "--station", station, "--show", "stripes", "--frames", 1)
    assert told.exit_code == 0, told.stderr
    assert f"saturated     {16 / WIDTH:.1%}" in told.stdout
    assert "frames per s  one frame alone" in told.stdout
    assert "levels        0 to 255 of 255" in told.stdout


def test_ctrl_c_is_its_end(station: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen = 0

    def refresh(words: str, **_: bool) -> None:
        nonlocal seen
        seen += bool(words)
        if words and seen == 4:
            raise KeyboardInterrupt

    monkeypatch.setattr(command, "_refresh", refresh)
    told = run("preview", "--station", station, "--show", "black")
    assert told.exit_code == 0, told.stderr
    assert "frames        4" in told.stdout


def test_a_camera_that_is_silent(station: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from functools import partial

    from fringeworks.devices import SimulatedBench, stations

    dead = partial(SimulatedBench, faults=Faults(dropped=range(10**6)))
    monkeypatch.setattr(stations, "SimulatedBench", dead)
    told = run("preview", "--station", station)
    assert told.exit_code == 3
    assert "simulated: no frame within" in told.stderr


def test_in_a_window(station: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pygame")
    with open_screens((320, 240)) as screens:
        monkeypatch.setenv("DISPLAY", screens.display)
        reds: list[int] = []

        def refresh(words: str, **_: bool) -> None:
            """After the first frame the window shows red where white saturates."""
            end_s = time.monotonic() + 2
            while reds and reds[-1] != WIDTH * HEIGHT and time.monotonic() < end_s:
                reds[-1] = int(np.all(screens.shot() == [255, 0, 0], axis=2).sum())
            if words:
                reds.append(0)

        monkeypatch.setattr(command, "_refresh", refresh)
        told = run("preview", "--station", station, "--frames", 2)
        assert told.exit_code == 0, told.stderr
        assert reds[0] == WIDTH * HEIGHT


def test_beside_a_projectors_window(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Both windows in one program: the projector's stays lit, and is closed last."""
    pytest.importorskip("pygame")
    install_toys(tmp_path, monkeypatch)
    path = tmp_path / "station.toml"
    path.write_text(
        'format = "fringeworks-station/1"\n[projector]\nkind = "window"\ndisplay = 1\n'
        '[camera]\nkind = "plugin"\nname = "toy"\n'
    )
    with open_screens((160, 120), (192, 256)) as screens:
        monkeypatch.setenv("DISPLAY", screens.display)
        lit: list[bool] = []

        def refresh(*_: str, **__: bool) -> None:
            end_s = time.monotonic() + 2
            while not (white := bool(np.all(screens.shot(1) == 255))) and time.monotonic() < end_s:
                time.sleep(0.01)
            lit.append(white)

        monkeypatch.setattr(command, "_refresh", refresh)
        told = run("preview", "--station", path, "--frames", 3, "--json")
        assert told.exit_code == 0, told.stderr
        assert lit[:3] == [True, True, True]
        assert json.loads(told.stdout)["frames"] == 3


def test_a_window_fits_its_display_and_leaves_the_projectors(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pygame = pytest.importorskip("pygame")
    assert display_beside(None) is None
    with open_screens((200, 100), (60, 40)) as screens:
        monkeypatch.setenv("DISPLAY", screens.display)
        assert [display_beside(used) for used in (None, 0, 1)] == [0, 1, 0]
        viewer = Viewer(width=400, height=400, display=0, alone=True)
        try:
            assert viewer._window.size == (80, 80)
            assert viewer.show(np.zeros((400, 400, 3), np.uint8), "a title")
            pygame.event.post(pygame.event.Event(pygame.WINDOWCLOSE))
            assert not viewer.show(np.zeros((400, 400, 3), np.uint8), "a title")
        finally:
            viewer.close()
            viewer.close()
        assert not pygame.display.get_init()
