"""``latency``: what it says of a station whose delay is known."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from fringeworks.files import write_rig
from tests.cli.scenes import run
from tests.devices.stages import RIG, MirrorStage


@pytest.fixture
def station(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A station whose stage has no optics, 42.5 ms late."""
    monkeypatch.setattr("fringeworks.twin.stage.Stage", lambda *_: MirrorStage())
    write_rig(tmp_path / "rig.json", RIG)
    path = tmp_path / "station.toml"
    path.write_text(
        'format = "fringeworks-station/1"\n[projector]\nkind = "simulated"\nlatency_ms = 42.5\n'
        '[camera]\nkind = "simulated"\n[simulated]\nscene = "wall"\nrig = "rig.json"\n'
        "[timing]\nsettle_ms = 43.0\n"
    )
    return path


def test_the_delay_is_told_with_the_timing_to_use(station: Path, tmp_path: Path) -> None:
    told = run("latency", "--station", station, "--figures", tmp_path / "figures")
    assert told.exit_code == 0, told.stderr
    assert "20 of 20 flashes" in told.stdout
    assert "display to image  42.5" in told.stdout
    assert "[timing]\nsettle_ms = 45.0\ndrop_frames = 0\n" in told.stdout
    assert "settle_ms of 43 is too short. Set settle_ms = 45" in told.stderr
    assert (tmp_path / "figures" / "latency.png").stat().st_size > 10_000


def test_the_same_as_json(station: Path) -> None:
    values = json.loads(run("latency", "--station", station, "--flashes", 9, "--json").stdout)
    assert values["delay_ms"]["median"] == pytest.approx(42.5, abs=0.1)
    assert values["interval_ms"] == pytest.approx(33.3, abs=0.01)
    assert (values["settle_ms"], values["drop_frames"], values["flashes"]) == (45.0, 0, 9)
    assert len(values["findings"]) == 1


def test_a_lens_cap_ends_with_3(station: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tests.devices.stages.seen", lambda image, _: image * 0)
    failed = run("latency", "--station", station)
    assert failed.exit_code == 3
    assert "error: the flash is not seen" in failed.stderr
