"""Every stage has its pictures; empty, tiny and incomplete data still have theirs."""

from __future__ import annotations

import copy
import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fringeworks.calibrate import calibrate_rig
from fringeworks.calibrate.record import read_record
from fringeworks.calibrate.settings import ImageSize
from fringeworks.errors import FormatError
from fringeworks.model import (
    AbsolutePhase,
    Cloud,
    CodedAxis,
    Fringe,
    Noise,
    Reason,
    Rig,
    Void,
    WrappedPhase,
)
from fringeworks.phase.decode import Decoding
from fringeworks.report.calibration import save_calibration
from fringeworks.report.cloud import save_cloud
from fringeworks.report.decoding import describe_share, draw_voids, save_decoding
from fringeworks.report.summary import (
    summarise_cloud,
    summarise_decoding,
    summarise_record,
    summarise_rig,
)
from tests.calibrate.synthetic import BOARD, board_poses, rig_state, views_of
from tests.scenes import RIG, plane_points

SHAPE = (24, 32)


def wrapped(*, void: bool = False) -> WrappedPhase:
    ramp = np.tile(np.linspace(-3, 3, SHAPE[1]), (SHAPE[0], 1)).astype(np.float32)
    nothing = np.full(SHAPE, np.nan, np.float32)
    flat = np.full(SHAPE, 50, np.float32)
    rules = np.full(SHAPE, Void.MODULATION if void else Void.VALID, np.uint8)
    phase = nothing if void else ramp
    sigma = nothing if void else np.full(SHAPE, 0.05, np.float32)
    fringe = Fringe("x", 32.0, (0.0, 2.0, 4.0))
    noise = Noise(0.5, 0.0, 0.0, "high-pass")
    return WrappedPhase(fringe, phase, flat * 2, flat, nothing, sigma, noise, rules)


def coded(*, void: bool = False, code_only: bool = False) -> CodedAxis:
    phase = wrapped(void=void)
    order = np.zeros(SHAPE, np.int32)
    absolute = AbsolutePhase(phase, order, phase.phase * 0 + np.float32(1))
    return CodedAxis(
        axis="x",
        coordinate=phase.phase * 5,
        sigma=phase.sigma,
        offset=phase.offset,
        modulation=phase.modulation,
        phase=None if code_only else absolute,
        void=phase.void,
        route=("Gray code of 32 px cells",),
    )


def names(paths: list[Path]) -> set[str]:
    assert all(path.is_file() and path.stat().st_size > 1000 for path in paths)
    return {path.stem for path in paths}


MAPS = {"modulation_x", "wrapped_x", "order_x", "column", "sigma_px_x", "voids_x"}


@pytest.mark.parametrize(
    ("decoding", "expected"),
    [
        (Decoding((coded(),), ()), MAPS),
        (Decoding((coded(void=True),), ()), MAPS),
        (Decoding((coded(code_only=True),), ()), {"modulation_x", "column", "voids_x"}),
        (Decoding((), ((wrapped(), "no code"),)), {"modulation_x", "wrapped_x", "voids_x"}),
    ],
    ids=["coded", "all void", "code alone", "relative"],
)
def test_a_decoding(decoding: Decoding, expected: set[str], tmp_path: Path) -> None:
    assert names(save_decoding(decoding, tmp_path / "new")) == expected


def test_shares_of_the_voids_are_in_the_legend() -> None:
    void = np.zeros((100, 100), np.uint8)
    void[:10], void[50, 50] = Void.MODULATION, Void.SATURATED
    figure = draw_voids(void, np.ones((100, 100), np.float32), "voids")
    told = [text.get_text().replace("\n", " ") for text in figure.legends[0].get_texts()]
    assert told == ["90.0% valid", "1 px saturated", "10.0% too little modulation"]
    assert describe_share(4, 10_000) == "4 px"


def cloud_of(xyz: Any, *, sigma: float = 0.05, epipolar: float = np.nan) -> Cloud:
    flat = np.where(np.isfinite(xyz[..., 2]), np.float32(sigma), np.float32(np.nan))
    return Cloud(
        xyz.astype(np.float32),
        flat,
        np.ones(xyz.shape[:2], np.float32),
        np.full(xyz.shape[:2], epipolar, np.float32),
    )


def test_a_cloud(tmp_path: Path) -> None:
    xyz = plane_points(RIG, (0.0, -0.2588190451, -0.9659258263), -760.0)
    xyz[:100, :100] = np.nan
    drawn = names(save_cloud(cloud_of(xyz, epipolar=0.1), tmp_path))
    assert drawn == {"depth", "sigma_mm", "epipolar_px", "cloud"}


def test_a_cloud_that_knows_more_of_its_points(tmp_path: Path) -> None:
    cloud = cloud_of(plane_points(RIG, (0.0, -0.2588190451, -0.9659258263), -760.0))
    reason = np.zeros(cloud.sigma_mm.shape, np.uint8)
    reason[:20], reason[30:33] = Reason.NOT_DECODED, Reason.MIXED
    cloud = dataclasses.replace(cloud, systematic_mm=3 * cloud.sigma_mm, reason=reason)
    drawn = names(save_cloud(cloud, tmp_path))
    assert drawn == {"depth", "sigma_mm", "systematic_mm", "reasons", "cloud"}
    summary = summarise_cloud(cloud)
    assert summary["systematic_mm_median"] == pytest.approx(0.15)
    assert summary["reasons"] == pytest.approx(
        {"not decoded": 20 / 480, "at an edge, seeing both sides of it": 3 / 480}
    )


@pytest.mark.parametrize(("shape", "count"), [((4, 5), 1), ((4, 5), 20), ((1, 7), 7)])
def test_a_few_points(shape: tuple[int, int], count: int, tmp_path: Path) -> None:
    xyz = np.full((*shape, 3), np.nan)
    xyz.reshape(-1, 3)[:count] = np.random.default_rng(1).normal((0, 0, 500), 1.0, (count, 3))
    cloud = cloud_of(xyz, sigma=np.nan)
    assert names(save_cloud(cloud, tmp_path)) == {"depth", "sigma_mm", "cloud"}
    summary = summarise_cloud(cloud)
    assert (summary["points"], summary["sigma_mm_median"]) == (count, None)


@pytest.fixture(scope="module")
def rig() -> Rig:
    rng = np.random.default_rng(7)
    views = views_of(rig_state(board_poses(4, rng=rng)), sigma=0.05, rng=rng)
    camera, projector = ImageSize(752, 480), ImageSize(608, 684)
    return calibrate_rig(views, BOARD, camera_size=camera, projector_size=projector)


def test_a_calibration(rig: Rig, tmp_path: Path) -> None:
    assert names(save_calibration(rig, tmp_path)) == {"residuals", "views", "coverage", "boards"}


def test_a_rig_without_record_cannot_be_drawn(rig: Rig, tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="keeps no record of its calibration"):
        save_calibration(dataclasses.replace(rig, further={}), tmp_path)


def test_a_damaged_record_is_refused(rig: Rig, tmp_path: Path) -> None:
    further = copy.deepcopy(dict(rig.further))
    del further["calibration"]["views"][2]["board_mm"]
    with pytest.raises(FormatError, match=r"calibration\.views\.2\.board_mm"):
        save_calibration(dataclasses.replace(rig, further=further), tmp_path)


def test_summary_of_a_rig(rig: Rig) -> None:
    summary, record = summarise_rig(rig), summarise_record(read_record(rig.further))
    assert summary["baseline_mm"] == pytest.approx(rig.baseline_mm)
    assert summary["rotation_deg"] == pytest.approx(np.rad2deg(np.hypot(0.28, 0.0224)), abs=0.3)
    assert [view["kept"] for view in record["views"]] == [BOARD.corner_count] * 4
    assert (record["failed_captures"], record["findings"]) == ([], [])
    nothing = summarise_record(None)
    assert nothing.keys() == record.keys()
    assert not any(nothing.values())


def test_summary_of_a_decoding() -> None:
    found = summarise_decoding(Decoding((coded(),), ()))["x"]
    assert (found["absolute"], found["valid_share"], found["voids"]) == (True, 1.0, {})
    assert found["noise"]["from"] == "high-pass differences of the frames"
    void = summarise_decoding(Decoding((coded(void=True, code_only=True),), ()))["x"]
    assert (void["sigma_px_median"], void["noise"]) == (None, None)
    assert void["voids"] == {"too little modulation": 1.0}
