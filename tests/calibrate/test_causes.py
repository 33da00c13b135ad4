"""Each fault, at the level of images where that is feasible, and the sentence it gets."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fringeworks.calibrate import (
    CalibrationSettings,
    ImageSize,
    View,
    calibrate_captures,
    calibrate_rig,
    observe_board,
)
from fringeworks.calibrate.judge.coverage import bare_parts
from fringeworks.calibrate.record import read_record
from fringeworks.errors import CalibrationError
from fringeworks.model import Capture, Rig
from fringeworks.phase.bit_order import find_bit_order
from fringeworks.phase.decode import decode_capture
from fringeworks.twin.scenes import PAPER
from tests.calibrate.faults import (
    BOARD,
    EFFECTS,
    HEIGHT,
    PLACES,
    SHOWN,
    TAKEN,
    TARGET,
    WIDTH,
    half_rig,
    moved,
    reordered,
    shoot_all,
    three_steps,
)
from tests.calibrate.synthetic import board_poses, rig_state, views_of

SETTINGS = CalibrationSettings(try_k3=False)
CORNERS_ONLY = replace(SETTINGS, dense=False)
CAMERA_SIZE = ImageSize(376, 240)


@pytest.fixture(scope="module")
def captures() -> list[Capture]:
    return shoot_all(4)


def seen_in(capture: Capture) -> View:
    return observe_board(capture, decode_capture(capture), TARGET, settings=SETTINGS, mirrored=True)


@pytest.fixture(scope="module")
def views(captures: list[Capture]) -> list[View]:
    return [seen_in(capture) for capture in captures]


def solve(views: Sequence[View], width: int = WIDTH, height: int = HEIGHT) -> Rig:
    return calibrate_rig(
        views,
        TARGET,
        camera_size=CAMERA_SIZE,
        projector_size=ImageSize(width, height),
        settings=SETTINGS,
    )


def told(rig: Rig) -> list[str]:
    record = read_record(rig.further)
    assert record is not None
    return [str(finding) for finding in record.findings]


def only(sentences: Sequence[str]) -> str:
    (sentence,) = sentences
    return sentence


def with_fault(captures: list[Capture], fault: str) -> list[Capture]:
    return [TAKEN[fault](capture) for capture in captures]


def test_a_clean_set_has_no_findings_and_is_right(views: list[View]) -> None:
    rig = solve(views)
    assert told(rig) == []
    # corners known to 0.005 px on four views: focal lengths to 1e-4, ten of them
    assert rig.camera.lens.fx == pytest.approx(half_rig().camera.lens.fx, rel=1e-3)
    assert rig.projector.lens.fy == pytest.approx(half_rig().projector.lens.fy, rel=1e-3)


# One capture among good ones: left out, and its reason is the assumption that mends it.


@pytest.mark.parametrize(
    ("fault", "cause"),
    [
        ("camera flipped", "the camera's image flipped left to right"),
        ("axes swapped", "the frames of the two axes swapped in capture.toml"),
    ],
)
def test_one_capture_the_wrong_way_round(
    views: list[View], captures: list[Capture], fault: str, cause: str
) -> None:
    rig = solve([*views[:2], seen_in(TAKEN[fault](captures[2])), views[3]])
    sentence = only(told(rig))
    assert sentence.startswith("warning: pose_2 was not used: its projector coordinates are mirr")
    assert "it fits them to 0.0" in sentence
    assert f"px with {cause}: undo that in this capture" in sentence
    assert rig.quality is not None
    assert (rig.quality.views_used, rig.quality.observations_offered) == (3, 4 * 35)


@pytest.mark.parametrize(
    ("shift_mm", "sets", "part"),
    [
        (2.0, (2, 3), r"its coordinates along y are 0\.\d+ px off and the others fit"),
        (2.0, (0, 1, 2, 3), r"its coordinates are 0\.\d+ px \(x\) and 0\.\d+ px \(y\) off"),
    ],
    ids=["between the axes", "before the white frame"],
)
def test_a_board_that_moved_during_a_capture(
    views: list[View], captures: list[Capture], shift_mm: float, sets: tuple[int, ...], part: str
) -> None:
    (x, y, z), turn = PLACES[2]
    spoilt = moved(captures[2], ((x, y, z + shift_mm), turn), sets)
    rig = solve([*views[:2], seen_in(spoilt), views[3]])
    sentence = only(told(rig))
    assert sentence.startswith("warning: pose_2 was not used")
    assert re.search(part, sentence)
    assert "board or rig moved" in sentence
    assert rig.projector.lens.fy == pytest.approx(half_rig().projector.lens.fy, rel=2e-3)


def test_one_blurred_capture_is_named(views: list[View], captures: list[Capture]) -> None:
    rig = solve([*views[:2], seen_in(TAKEN["blurred"](captures[2])), views[3]])
    assert only(told(rig)).startswith("warning: pose_2 is blurred: 2.0 px in its image, 0.4 px")


# All captures alike: refused with the assumption under which they fit, or found.


def test_all_captures_with_their_axes_swapped(captures: list[Capture]) -> None:
    with pytest.raises(CalibrationError, match="exchange axis x and y of its sets") as error:
        calibrate_captures(with_fault(captures[:3], "axes swapped"), TARGET, settings=CORNERS_ONLY)
    assert "in all 3 views. They fit to 0.0" in str(error.value)
    assert "px with the frames of the two axes swapped in capture.toml" in str(error.value)


def test_a_projector_image_flipped_on_the_panel() -> None:
    flipped = shoot_all(3, shown=SHOWN["left to right"])
    with pytest.raises(CalibrationError, match="projector's image flipped left to right"):
        calibrate_captures(flipped, TARGET, settings=CORNERS_ONLY)


@pytest.mark.parametrize(
    ("signs", "cause"), [((1, -1), "flipped top to bottom"), ((-1, 1), "flipped left to right")]
)
def test_which_way_the_projector_is_flipped(signs: tuple[int, int], cause: str) -> None:
    views = views_of(rig_state(board_poses(4, rng=np.random.default_rng(3))))
    spoilt = [replace(view, projector_px=view.projector_px * signs) for view in views]
    with pytest.raises(CalibrationError, match=f"with the projector's image {cause}"):
        solve(spoilt)
    upside_down = [replace(view, projector_px=view.projector_px * [-1, -1]) for view in views]
    assert solve(upside_down).quality is not None  # a projector on its head is no fault


@pytest.mark.parametrize(
    ("fault", "order"), [("bits reversed", "5 4 3 2 1"), ("two bits swapped", "1 2 4 3 5")]
)
def test_gray_bits_out_of_order(captures: list[Capture], fault: str, order: str) -> None:
    with pytest.raises(CalibrationError, match="at least 3 views") as error:
        calibrate_captures(with_fault(captures, fault), TARGET, settings=CORNERS_ONLY)
    text = str(error.value)
    assert f"fit together along x as {order} and along y as {order}, most significant" in text
    assert text.count("out of order") == 1  # once for all four
    assert "pose_0, pose_1, pose_2, pose_3: the Gray bits" in text


@pytest.mark.parametrize("bits", [(0, 2), (1, 4), (3, 4)])
def test_any_two_bits_with_edges_in_view(captures: list[Capture], bits: tuple[int, int]) -> None:
    """Along y, where this capture sees edges of all five bits."""
    order = list(range(5))
    order[bits[0]], order[bits[1]] = bits[1], bits[0]
    spoilt = reordered(lambda count: order)(captures[0])
    assert find_bit_order(spoilt, "y") == tuple(order)
    assert find_bit_order(captures[0], "y") is None


def test_width_and_height_exchanged(captures: list[Capture]) -> None:
    exchanged = [seen_in(capture) for capture in with_fault(captures[:3], "size exchanged")]
    sentence = only([text for text in told(solve(exchanged, HEIGHT, WIDTH)) if "point" in text])
    assert "the middle of its 342 x 304 px in neither direction" in sentence
    assert "With the two exchanged it would be." in sentence


def test_the_size_of_another_projector(views: list[View]) -> None:
    sentence = only([text for text in told(solve(views, 640, 400)) if "point" in text])
    assert "the middle of its 640 x 400 px in neither direction. Check the proj" in sentence


@pytest.mark.parametrize(
    ("pitch_mm", "unit"), [(0.013, "were it in m, 646 mm"), (13000.0, "were it in um, 646 mm")]
)
def test_a_pitch_in_another_unit_is_refused(views: list[View], pitch_mm: float, unit: str) -> None:
    board = [replace(view, board_mm=view.board_mm * pitch_mm / 13.0) for view in views]
    with pytest.raises(CalibrationError, match=r"must be in mm \(" + unit.split()[0]) as error:
        solve(board)
    assert unit[:12] in str(error.value)


def test_a_pitch_in_inches_is_found(views: list[View]) -> None:
    board = [replace(view, board_mm=view.board_mm / 25.4) for view in views]
    sentence = only(told(solve(board)))
    assert "the board comes out 2" in sentence
    assert "not in mm (were it in inches, 6" in sentence


def calibrated(captures: list[Capture]) -> Rig:
    return calibrate_captures(captures, TARGET, settings=SETTINGS)


def test_gamma_ripples_under_three_steps() -> None:
    curved = replace(EFFECTS, projector=replace(EFFECTS.projector, gamma=2.0))
    sentences = told(calibrated(shoot_all(3, effects=curved)))
    assert len(sentences) == 2
    # three steps under gamma 2: B2 / B1 = 1/4, so 0.25 rad, less by blur and black light
    for axis, sentence in zip("xy", sentences, strict=True):
        assert f"the phase along {axis} ripples by 0." in sentence
        assert 0.15 < float(sentence.split("ripples by ")[1].split()[0]) < 0.25
        assert "3 waves per period" in sentence
        assert "gamma" in sentence


def test_an_image_scaled_to_the_nearest_pixel_beats() -> None:
    images: dict[str, Any] = {"shown": SHOWN["to the nearest pixel"]}
    rig = calibrated(shoot_all(3, sequence=three_steps(338, 380), **images))
    sentences = told(rig)
    assert len(sentences) == 2
    # 338 columns on 304: every 9.94th is dropped, and half a pixel either way is 1/pi px of wave
    for sentence in sentences:
        swing, period = sentence.split("ripple by ")[1].split(" px every ")
        assert float(swing) == pytest.approx(1 / np.pi, rel=0.2)
        assert float(period.split()[0]) == pytest.approx(9.94, rel=0.04)
        assert "native resolution" in sentence


def test_an_image_stretched_on_its_way_to_the_panel() -> None:
    rig = calibrated(shoot_all(3, sequence=three_steps(456, 570), shown=SHOWN["smoothly"]))
    # (570 / 342) / (456 / 304) of the panel's own 2
    assert "fy / fx = 2.22" in only(told(rig))
    assert "native resolution" in only(told(rig))


def test_very_black_squares_are_harmless(views: list[View]) -> None:
    black = shoot_all(2, material=replace(PAPER, dark_albedo=0.004))
    rig = solve([*map(seen_in, black), *views[2:]])
    assert told(rig) == []
    assert rig.quality is not None
    assert rig.quality.observations_used == 4 * 35
    assert rig.camera.lens.fx == pytest.approx(half_rig().camera.lens.fx, rel=1e-3)


def test_a_bowed_board_is_named_with_its_bow() -> None:
    bowed = shoot_all(3, board=replace(BOARD, bow_mm=(0.5, 0.3)))
    bent = only([text for text in told(calibrated(bowed)) if "bowed" in text])
    # over the corners' span the sheet's 0.5 and 0.3 mm are (57 / 86)^2 and (38 / 67)^2 of them
    heights = re.search(r"middle stands ([\d.]+) and ([\d.]+) mm off its edges", bent)
    assert heights is not None
    assert [float(height) for height in heights.groups()] == pytest.approx([0.22, 0.10], abs=0.02)
    assert "--board-shape paraboloid" in bent


def test_bare_parts_of_an_image() -> None:
    size = ImageSize(90, 60)
    x, y = np.meshgrid(np.arange(90.0), np.arange(60.0))
    used = np.column_stack([x.ravel(), y.ravel()])
    parts, share = bare_parts(used, used, size)
    assert (parts, share) == ([], 0.0)
    parts, share = bare_parts(used, used[(used[:, 0] < 58) & (used[:, 1] < 19)], size)
    assert parts == [
        "upper right",
        "middle left",
        "middle",
        "middle right",
        "lower left",
        "lower middle",
        "lower right",
    ]
    assert share == pytest.approx(7 / 9)


def test_boards_in_one_corner_of_the_image() -> None:
    poses = board_poses(5, rng=np.random.default_rng(3))
    poses[:, 3:] *= 3.0  # three times as far, a third as large
    views = views_of(rig_state(poses), sigma=0.02)
    rig = calibrate_rig(
        views,
        TARGET,
        camera_size=ImageSize(752, 480),
        projector_size=ImageSize(608, 684),
        settings=SETTINGS,
    )
    bare = [text for text in told(rig) if "no board was in" in text]
    assert any("of the camera's image" in text for text in bare)
    assert all("Add poses" in text for text in bare)
