"""The demo's second part, on the real capture that it prefers."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

import pytest

from fringeworks.experiments import real_boards
from fringeworks.experiments.real_boards import (
    REAL_SETS,
    RealLine,
    compare_rig,
    find_real_set,
    run_real_line,
)
from fringeworks.files import read_cloud, read_rig
from fringeworks.model import Capture, Rig, Target
from fringeworks.model.progress import no_progress

REFERENCE_PX = {"camera rms": 0.19, "projector rms": 0.26, "joint rms": 0.23}
"""Plain OpenCV leaves 0.179, 0.248 and 0.222 px (README of procam-half)."""

Real = Callable[[str], Path]


@pytest.fixture(scope="module")
def made(real: Real, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, RealLine]:
    real("procam-half")
    folder = tmp_path_factory.mktemp("real")
    return folder, run_real_line(REAL_SETS[0], folder, progress=no_progress)


def test_the_rig_meets_the_bars(made: tuple[Path, RealLine]) -> None:
    rows = {row.name: row for row in compare_rig(made[1])}
    for name, bar in REFERENCE_PX.items():
        assert rows[name].kept <= bar
        over_all = rows[name].over_all
        assert over_all is not None
        assert over_all >= rows[name].kept
    assert rows["baseline"].kept == pytest.approx(rows["baseline"].opencv, rel=0.005)
    quality = made[1].rig.quality
    assert quality is not None
    assert quality.views_used == 4
    assert quality.observations_offered == 4 * 63
    assert quality.observations_used >= 0.98 * quality.observations_offered


def test_the_squares_of_every_board_have_their_size(made: tuple[Path, RealLine]) -> None:
    """75 mm; 0.2 mm is the bar for the mean. The planes: sigma of a Gray cell alone is 2.8 mm."""
    boards = made[1].boards
    assert [name for name, _, _ in boards] == [f"capture_{i}" for i in range(4)]
    for _, spacing, plane in boards:
        assert spacing.mean_mm == pytest.approx(75.0, abs=0.2)
        assert len(spacing.all_mm) >= 100
        assert plane.fit.form_rms_mm <= 3.3
        assert 0.9 < plane.fit.form_rms_mm / plane.predicted_rms_mm < 1.1


def test_rig_and_first_cloud_are_kept(made: tuple[Path, RealLine]) -> None:
    folder, line = made
    assert line.first is not None
    assert line.first.capture.name == "capture_0"
    assert read_rig(folder / "rig.json").baseline_mm == line.rig.baseline_mm
    assert read_cloud(folder / "cloud.npz").valid.sum() == line.first.cloud.valid.sum()


def test_quick_scans_one_board(
    made: tuple[Path, RealLine], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Calibrated from all poses nevertheless; the rig of `made` stands for that calibration."""
    asked: list[str] = []

    def calibrate(captures: Iterable[Capture], board: Target) -> Rig:
        asked.extend(capture.name for capture in captures)
        return made[1].rig

    monkeypatch.setattr(real_boards, "calibrate_captures", calibrate)
    line = run_real_line(REAL_SETS[0], tmp_path, quick=True, progress=no_progress)
    assert len(line.boards) == 1
    assert asked == [f"capture_{i}" for i in range(4)]


def test_without_images_there_is_no_set(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FRINGEWORKS_DATA", str(tmp_path))
    assert find_real_set() is None
    (tmp_path / "real" / "procam-graycode").mkdir(parents=True)
    assert find_real_set() == REAL_SETS[1]
