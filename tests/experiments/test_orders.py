"""The study of fringe orders: what it counts, on orders that are known; and that it runs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fringeworks.acquire.simulated import write_simulations
from fringeworks.errors import DecodeError
from fringeworks.experiments import orders
from fringeworks.experiments.order_figure import LEAST_SHARE, _look, draw_orders
from fringeworks.experiments.order_trials import (
    B_SHARE,
    CONDITIONS,
    CONTENDERS,
    Condition,
    Contender,
    Told,
    judge,
    run_trials,
)
from fringeworks.experiments.orders import half_camera, study_orders
from fringeworks.experiments.truth import inner_pixels
from fringeworks.files import read_capture
from fringeworks.files.truth import read_truth
from fringeworks.model import AbsolutePhase
from fringeworks.phase.chained import order_by_gray
from fringeworks.phase.decode import decode_capture
from fringeworks.phase.orders import AxisFrames, Ordered
from fringeworks.twin.effects import CameraEffects, Effects, crosstalk_response
from fringeworks.twin.scenes import paper_rig, two_scene
from fringeworks.twin.simulate import Simulation, simulate

RIG = half_camera(half_camera(paper_rig()))
GRAY = Contender("complementary gray", order_by_gray, {"code": "complementary"})


@pytest.fixture(scope="module")
def made() -> Simulation:
    rng = np.random.default_rng(0)
    return simulate(two_scene(), RIG, GRAY.sequence(RIG), effects=Effects(), rng=rng)


def judged(made: Simulation, contender: Contender) -> Told:
    return judge(contender, made.capture, made.truth, RIG)


def test_right_orders_are_right(made: Simulation) -> None:
    told = judged(made, GRAY)
    assert told.pixels > 5000
    assert (told.wrong, told.refusal) == (0, "")
    assert told.coverage > 0.99


def test_wrong_and_void_orders_are_counted(made: Simulation) -> None:
    """One order too many in the left half of the image, none in its upper half."""

    def spoilt(frames: AxisFrames) -> Ordered:
        right = order_by_gray(frames)
        order, margin = right.phase.order.copy(), right.phase.margin.copy()
        order[:, : order.shape[1] // 2] += 1
        margin[: order.shape[0] // 2] = np.nan
        return Ordered(AbsolutePhase(right.phase.wrapped, order, margin), ())

    clean, told = judged(made, GRAY), judged(made, replace(GRAY, tell=spoilt))
    assert told.pixels == clean.pixels
    assert 0.3 < told.coverage < 0.7
    assert 0.3 < told.wrong_share < 0.9


def test_a_refusal_is_no_order(made: Simulation) -> None:
    def refuse(frames: AxisFrames) -> Ordered:
        raise DecodeError("no such code")

    told = judged(made, replace(GRAY, tell=refuse))
    assert (told.certain, told.refusal) == (0, "no such code")
    assert np.isnan(told.wrong_share)


def test_the_noise_is_the_share_of_b_that_it_says(made: Simulation) -> None:
    """Read noise alone, of the median pixel: B_SHARE is what the scene gives, to a tenth."""
    condition = next(item for item in CONDITIONS if item.name == "noise")
    effects = condition.change(Effects(), 0.1)
    sigma = effects.camera.read_noise_e / effects.camera.full_well_e * 255
    black, white = made.capture.black(), made.capture.white()
    assert black is not None
    assert white is not None
    lit = np.isfinite(made.truth.column)
    b = np.median((white - black)[lit]) / 2
    assert sigma / b == pytest.approx(0.1, rel=0.1)
    assert b / 255 == pytest.approx(B_SHARE, rel=0.1)


def test_frames_are_counted_as_the_camera_takes_them() -> None:
    counted = {item.name: item.frames(RIG) for item in CONTENDERS}
    expected = {"gray": 8, "complementary gray": 9, "staircase": 6, "colour": 6, "hierarchical": 9}
    assert counted == counted | expected | {"code-frame": 4, "objects": 3, "depth-window": 3}


def test_one_capture_serves_all_that_read_it(monkeypatch: pytest.MonkeyPatch) -> None:
    calls = []

    def counting(*args: object, **options: object) -> Simulation:
        calls.append(args)
        return simulate(*args, **options)  # type: ignore[arg-type]

    monkeypatch.setattr("fringeworks.experiments.order_trials.simulate", counting)
    same = (GRAY, replace(GRAY, name="again"))
    told = run_trials(same, two_scene(), RIG, Effects(), rng=np.random.default_rng(0))
    assert len(calls) == 1
    assert told["again"] == told["complementary gray"]


def test_colours_survive_the_files_and_the_whole_line(tmp_path: Path) -> None:
    contender = next(item for item in CONTENDERS if item.name == "colour")
    effects = replace(Effects(), camera=CameraEffects(colour_response=crosstalk_response(0.1)))
    sequence = contender.sequence(RIG)
    write_simulations(two_scene(), RIG, sequence, tmp_path, effects=effects)
    column = decode_capture(read_capture(tmp_path)).column
    assert column is not None
    assert column.route == ("colour frame of 6 colours",)
    truth = read_truth(tmp_path / "truth.npz")
    use = inner_pixels(truth) & np.isfinite(column.coordinate)
    assert use.sum() > 0.99 * inner_pixels(truth).sum()
    assert np.abs(column.coordinate - truth.column)[use].max() < 16  # half a fringe


def test_half_the_camera_sees_the_same() -> None:
    """The corners of the image, at -1/2, stay in the same directions."""
    whole, half = paper_rig().camera, half_camera(paper_rig()).camera
    assert (half.width, half.height) == (whole.width // 2, whole.height // 2)
    assert (half.lens.cx + 0.5) / half.lens.fx == pytest.approx(
        (whole.lens.cx + 0.5) / whole.lens.fx, rel=1e-12
    )


def test_the_study_runs(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    noise, *_, crosstalk = CONDITIONS
    contenders = tuple(c for c in CONTENDERS if c.name in ("complementary gray", "colour"))
    monkeypatch.setattr(orders, "CONDITIONS", (noise, crosstalk))
    monkeypatch.setattr(orders, "CONTENDERS", contenders)
    monkeypatch.setattr(orders, "half_camera", lambda rig: RIG)
    study = study_orders(tmp_path, quick=True)
    assert study.head == ("method", "frames", "noise 0.2", "crosstalk 0.2")
    assert [row[:2] for row in study.rows] == [("complementary gray", "9"), ("colour", "6")]
    assert study.rows[0][3] == "-"
    assert study.rows[1][3].startswith("0.00% of ")
    assert study.numbers["levels"] == {"noise": (0.01, 0.2), "crosstalk": (0.0, 0.2)}
    assert len(study.draw().axes) == 4


def test_nothing_wrong_is_drawn_at_the_bottom() -> None:
    condition = Condition("noise", "sigma / B", (0.1, 0.2), 0.2, lambda effects, level: effects)
    told = [{"one": Told(100, 50, 0)}, {"one": Told(100, 0, 0)}]
    figure = draw_orders({"noise": told}, [condition], ["one"])
    above, below = (np.column_stack(axes.lines[0].get_data()) for axes in figure.axes)
    np.testing.assert_allclose(above, [[0.1, LEAST_SHARE], [0.2, np.nan]])
    np.testing.assert_allclose(below, [[0.1, 0.5], [0.2, 1.0]])


def test_single_points_tell_their_method_too() -> None:
    # A method that is certain of something at one level only has a marker and no line.
    looks = [_look(number) for number in range(len(CONTENDERS))]
    points = {(one["marker"], one["color"], one["markerfacecolor"]) for one in looks}
    assert len(points) == len(CONTENDERS)
