from __future__ import annotations

import gc
import json
import re
import weakref
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.calibrate import (
    CalibrationSettings,
    ImageSize,
    View,
    calibrate_captures,
    calibrate_rig,
)
from fringeworks.calibrate import solve as solve_module
from fringeworks.calibrate.adjust.start import start_state
from fringeworks.calibrate.record import read_record
from fringeworks.errors import CalibrationError, DecodeError, FormatError
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.model import Capture, Rig, Sensor, Sequence
from fringeworks.model.sequence import PatternSet, Uniform
from tests.calibrate.synthetic import (
    BOARD,
    CAMERA,
    PROJECTOR,
    RELATION,
    board_poses,
    rig_state,
    square_sides,
    triangulate_corners,
    views_of,
)

CAMERA_SIZE, PROJECTOR_SIZE = ImageSize(752, 480), ImageSize(608, 684)
SIGMA = 0.05
POSES = board_poses(5, rng=np.random.default_rng(3))


def calibrate(views: list[View], failed: tuple[tuple[str, str], ...] = ()) -> Rig:
    return calibrate_rig(
        views,
        BOARD,
        camera_size=CAMERA_SIZE,
        projector_size=PROJECTOR_SIZE,
        failed=failed,
    )


@pytest.fixture(scope="module")
def views() -> list[View]:
    return views_of(rig_state(POSES), sigma=SIGMA, rng=np.random.default_rng(3))


@pytest.fixture(scope="module")
def rig(views: list[View]) -> Rig:
    return calibrate(views)


def test_clean_views_give_the_rig_back() -> None:
    rig = calibrate(views_of(rig_state(POSES)))
    np.testing.assert_allclose(rig.camera.lens.vector, CAMERA, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(rig.projector.lens.vector, PROJECTOR, rtol=1e-6, atol=1e-6)
    pose = rig.projector_from_camera
    np.testing.assert_allclose(pose.rotation, rotation_matrix(RELATION[:3]), atol=1e-7)
    np.testing.assert_allclose(pose.translation_mm, RELATION[3:], atol=1e-4)


def test_quality_counts_and_root_mean_squares(rig: Rig) -> None:
    quality = rig.quality
    assert quality is not None
    assert (quality.views_used, quality.observations_used) == (5, 440)
    assert quality.observations_offered == 440
    # 880 coordinates less 30 of poses and most of 18; the sampled rms of so many spreads by 2 %
    expected = SIGMA * np.sqrt(2 * (1 - 48 / 880))
    assert quality.camera_rms_px == pytest.approx(expected, rel=0.08)
    # a corner's error moves the computed corner's distance in the projector by the ratio of the
    # focal lengths, and the maps' own noise comes on top
    squares = [1 + (PROJECTOR[axis] / CAMERA[axis]) ** 2 for axis in (0, 1)]
    assert quality.projector_rms_px == pytest.approx(SIGMA * np.sqrt(sum(squares)), rel=0.08)
    joint = np.sqrt((quality.camera_rms_px**2 + quality.projector_rms_px**2) / 2)
    assert quality.joint_rms_px == pytest.approx(joint)


def test_sizes_and_volume(rig: Rig) -> None:
    assert (rig.camera.width, rig.camera.height) == (752, 480)
    assert (rig.projector.width, rig.projector.height) == (608, 684)
    depths = [(BOARD.corners_mm() @ rotation_matrix(p[:3]).T + p[3:])[:, 2] for p in POSES]
    near, far = np.min(depths), np.max(depths)
    assert rig.volume_mm == pytest.approx((near, far), abs=5.0)


def test_record_is_json_and_solves_to_the_same_rig(rig: Rig) -> None:
    record = read_record(json.loads(json.dumps(rig.further, allow_nan=False)))
    assert record is not None
    again = calibrate([entry.view for entry in record.views])
    np.testing.assert_allclose(again.camera.lens.vector, rig.camera.lens.vector, rtol=1e-6)
    assert again.quality is not None
    assert rig.quality is not None
    assert again.quality.joint_rms_px == pytest.approx(rig.quality.joint_rms_px, rel=1e-6)
    assert again.quality.observations_used == rig.quality.observations_used


def test_record_says_view_by_view(rig: Rig) -> None:
    record = rig.further["calibration"]
    assert record["board"]["columns"] == BOARD.columns
    assert record["settings"]["camera_free"] == CalibrationSettings().camera_free
    assert record["failed_captures"] == []
    assert record["findings"] == []
    first = record["views"][0]
    assert (first["name"], first["offered"], first["kept"]) == ("pose_0", 88, 88)
    residuals = np.array(first["camera_residual_px"])
    rms = np.sqrt(np.mean(np.sum(residuals**2, axis=1)))
    assert first["camera_rms_px"] == pytest.approx(rms)
    assert record["rms_of_all_px"]["joint"] == pytest.approx(rig.quality.joint_rms_px)  # type: ignore[union-attr]


def test_a_record_is_read_back_as_it_was_written(rig: Rig, views: list[View]) -> None:
    record = read_record(rig.further)
    assert record is not None
    assert [entry.name for entry in record.views] == [view.name for view in views]
    for entry, view, pose in zip(record.views, views, POSES, strict=True):
        np.testing.assert_array_equal(entry.view.pixels, view.pixels)
        np.testing.assert_array_equal(entry.view.projector_sigma_px, view.projector_sigma_px)
        assert entry.view.reasons == view.reasons
        assert (entry.kept_count, entry.offered_count) == (88, 88)
        assert entry.camera_from_board.translation_mm == pytest.approx(pose[3:], abs=5.0)
        rms = np.sqrt(np.mean(np.sum(entry.camera_residual_px**2, axis=1)))
        assert entry.camera_rms_px == pytest.approx(rms)
    assert read_record({}) is None


DAMAGES: dict[str, Callable[[Any], object]] = {
    "calibration": lambda further: further.update(calibration=[]),
    "calibration.views": lambda further: further["calibration"].update(views=[]),
    "calibration.findings": lambda further: further["calibration"].pop("findings"),
    "calibration.failed_captures.0.reason": lambda further: further["calibration"].update(
        failed_captures=[{"name": "dark"}]
    ),
    "calibration.views.1.projector_px": lambda further: further["calibration"]["views"][1].pop(
        "projector_px"
    ),
    "calibration.views.1.camera_px.0.1": lambda further: further["calibration"]["views"][1][
        "camera_px"
    ].insert(0, [1.0, "two"]),
    "calibration.views.1.board_mm.0.1": lambda further: further["calibration"]["views"][1][
        "board_mm"
    ].insert(0, [0.0, 1e300, 0.0]),
    "calibration.views.1.projector_sigma_px.0.0": lambda further: further["calibration"]["views"][
        1
    ]["projector_sigma_px"].insert(0, [-1.0, 1.0]),
    "calibration.views.1.camera_sigma_px": lambda further: further["calibration"]["views"][1][
        "camera_sigma_px"
    ].pop(),
    "calibration.views.0.camera_from_board.rotation": lambda further: further["calibration"][
        "views"
    ][0]["camera_from_board"].update(rotation=[[1, 0, 0], [0, 1, 0]]),
}


@pytest.mark.parametrize("key", DAMAGES)
def test_a_damaged_record_is_refused_by_its_key(rig: Rig, key: str) -> None:
    further = json.loads(json.dumps(rig.further))
    DAMAGES[key](further)
    with pytest.raises(FormatError, match=rf"damaged: {re.escape(key)}\b"):
        read_record(further)


def test_squares_of_a_pose_it_never_saw(rig: Rig) -> None:
    pose = board_poses(1, rng=np.random.default_rng(77))
    (view,) = views_of(rig_state(pose))
    sides = square_sides(triangulate_corners(rig, view.camera_px, view.projector_px), BOARD)
    assert sides.mean() == pytest.approx(13.0, abs=0.02)


def told(rig: Rig) -> list[str]:
    """The findings of a calibration as sentences."""
    record = read_record(rig.further)
    assert record is not None
    return [str(finding) for finding in record.findings]


def bent(views: list[View], corners: dict[tuple[int, int], float]) -> list[View]:
    """Views whose corners (view, corner) are shifted by so many px in the camera's x."""
    out = [replace(view, camera_px=view.camera_px.copy()) for view in views]
    for (view, corner), shift in corners.items():
        out[view].camera_px[corner, 0] += shift
    return out


def test_wrong_corners_are_left_out_and_counted(views: list[View], rig: Rig) -> None:
    spoilt = calibrate(bent(views, {(0, 0): 6.0, (3, 17): -4.0}))
    quality = spoilt.quality
    assert quality is not None
    assert (quality.observations_used, quality.observations_offered) == (438, 440)
    entry = spoilt.further["calibration"]["views"][0]
    assert entry["left_out"] == {"does not fit the other corners": 1}
    assert entry["reasons"][0] == "does not fit the other corners"
    assert entry["camera_residual_px"][0][0] == pytest.approx(6.0, abs=0.4)
    assert spoilt.further["calibration"]["rms_of_all_px"]["camera"] > 2 * quality.camera_rms_px
    assert spoilt.further["calibration"]["findings"] == []  # told in `left_out`
    assert rig.camera.lens.fx == pytest.approx(spoilt.camera.lens.fx, rel=2e-3)


def test_no_more_than_two_percent_are_left_out(views: list[View]) -> None:
    spoilt = calibrate(bent(views, {(1, corner): 4.0 for corner in range(0, 60, 3)}))
    assert spoilt.quality is not None
    assert spoilt.quality.observations_used == 440 - 8  # 2 % of 440, rounded down


def test_captures_that_failed_count_as_offered(views: list[View]) -> None:
    rig = calibrate(views, (("dark", "no board was found"),))
    assert rig.quality is not None
    assert rig.quality.observations_offered == 440 + 88
    assert told(rig) == ["warning: dark was not used: no board was found"]


def test_two_views_are_not_enough(views: list[View]) -> None:
    with pytest.raises(CalibrationError, match="at least 3 views") as error:
        calibrate(views[:2], (("a", "no board"), ("b", "only axis x is coded")))
    assert "2 can be used (pose_0, pose_1); 2 failed" in str(error.value)
    assert "a: no board" in str(error.value)
    assert "b: only axis x is coded" in str(error.value)


def test_parallel_boards() -> None:
    poses = POSES.copy()
    poses[:, :3] = poses[0, :3] + np.random.default_rng(0).normal(0, 0.02, (5, 3))
    with pytest.raises(CalibrationError, match=r"same orientation in all 5 views .*tilted by 20"):
        calibrate(views_of(rig_state(poses), sigma=SIGMA))


def test_weak_tilt_is_a_finding() -> None:
    rng = np.random.default_rng(5)
    poses = board_poses(6, rng=rng, tilt=0.13)
    rig = calibrate(views_of(rig_state(poses), sigma=0.01, rng=rng))
    assert any("tilted by at most" in found for found in told(rig))


def only_one(sentences: list[str]) -> str:
    (sentence,) = sentences
    return sentence


def with_projector(view: View, projector_px: NDArray[np.float64]) -> View:
    return replace(view, projector_px=projector_px)


def test_mirrored_projector_names_the_view(views: list[View]) -> None:
    flipped = [
        with_projector(view, view.projector_px * [-1, 1] + [607, 0]) if i == 2 else view
        for i, view in enumerate(views)
    ]
    sentence = only_one(told(calibrate(flipped)))
    assert "pose_2 was not used: its projector coordinates are mirrored" in sentence
    assert "with the projector's image flipped left to right" in sentence


def test_swapped_axes(views: list[View]) -> None:
    swapped = [with_projector(view, view.projector_px[:, ::-1]) for view in views]
    with pytest.raises(CalibrationError, match="frames of the two axes swapped"):
        calibrate(swapped)


def test_gray_bits_out_of_order(views: list[View]) -> None:
    scrambled = []
    for view in views[:4]:
        column = np.rint(view.projector_px[:, 0]).astype(int) ^ 37
        scrambled.append(with_projector(view, np.stack([column, view.projector_px[:, 1]], axis=1)))
    with pytest.raises(CalibrationError, match=r"px rms, worst in pose_\d .*Gray bits out of"):
        calibrate(scrambled)


def test_a_moved_board_is_named(views: list[View]) -> None:
    shifted = with_projector(views[2], views[2].projector_px + np.array([60, 0]))
    moved = [*views[:2], shifted, *views[3:]]
    with pytest.raises(CalibrationError, match=r"worst in pose_2 .*Without pose_2") as error:
        calibrate(moved)
    assert "moved during a capture" in str(error.value)


def test_projector_coordinates_of_another_pose(views: list[View]) -> None:
    mixed = [*views[:2], with_projector(views[2], views[3].projector_px), views[3]]
    with pytest.raises(CalibrationError, match=r"Without pose_2 the others fit to 0\.\d+ px"):
        calibrate(mixed)


def test_corners_that_fit_no_board(views: list[View]) -> None:
    scatter = np.random.default_rng(0).normal(0, 20, views[1].camera_px.shape)
    torn = replace(views[1], camera_px=views[1].camera_px + scatter)
    with pytest.raises(CalibrationError, match=r"do not fit a board, worst in pose_1") as error:
        calibrate([views[0], torn, *views[2:]])
    assert "Without pose_1 the others fit" in str(error.value)


def kept_only(view: View, count: int) -> View:
    reasons = ["left out"] * BOARD.corner_count
    reasons[:count] = [""] * count
    return replace(view, reasons=tuple(reasons))


@pytest.mark.parametrize(
    "thin",
    [
        lambda view: kept_only(view, 3),
        lambda view: kept_only(view, BOARD.columns),
        lambda view: replace(view, camera_px=view.camera_px * [1, 0] + [0, 200]),
    ],
    ids=["three corners", "one row of the board", "one line in the image"],
)
def test_corners_that_fix_no_lens(views: list[View], thin: Callable[[View], View]) -> None:
    """OpenCV's own error for such corners never gets through, and the view is named."""
    with pytest.raises(CalibrationError, match=r"kept in pose_1 are fewer than four, or lie on"):
        start_state([views[0], thin(views[1]), *views[2:]], CAMERA_SIZE)


def test_projector_coordinates_that_never_change(views: list[View]) -> None:
    stuck = [with_projector(view, view.projector_px * 0 + [300, 200]) for view in views]
    with pytest.raises(CalibrationError, match="all projector coordinates are the same"):
        calibrate(stuck)


def test_pitches_that_make_pixels_oblong_are_refused_or_found(views: list[View]) -> None:
    views = views[:4]

    def with_pitch_y(factor: float) -> list[View]:
        return [replace(view, board_mm=view.board_mm * [1, factor, 1]) for view in views]

    with pytest.raises(CalibrationError, match="check the board's pitches in x and y"):
        calibrate(with_pitch_y(1.3))
    found = told(calibrate(with_pitch_y(1.05)))
    assert any("focal lengths differ by" in sentence for sentence in found)
    assert not any("focal lengths differ" in sentence for sentence in told(calibrate(views)))


def test_the_same_view_twice_is_no_view_more(views: list[View]) -> None:
    with pytest.raises(CalibrationError, match="pose_1 and again show the board in the same place"):
        calibrate([*views[:2], replace(views[1], name="again")])


# From captures: what decodes and what is seen is given, so that only the glue is under test.


def capture(name: str, width: int = 752, projector: int = 608) -> Capture:
    frames = np.zeros((1, 480, width), np.uint8)
    sequence = Sequence(projector, 684, (PatternSet(Uniform(1.0)),))
    return Capture(sequence, (frames,), Sensor(255.0), name=name)


@pytest.fixture
def seen(views: list[View], monkeypatch: pytest.MonkeyPatch) -> None:
    """Captures called pose_0 ... pose_4 give the synthetic views; any other has no board."""
    by_name = {view.name: view for view in views}

    def decode(capture: Capture) -> str:
        if capture.name == "dark":
            raise DecodeError("no pixel is valid along x")
        return capture.name

    def observe(capture: Capture, projector_map: str, *_: object, **__: object) -> View:
        if projector_map not in by_name:
            raise CalibrationError(f"{capture.name}: no board of 11 x 8 inner corners was found")
        return by_name[projector_map]

    monkeypatch.setattr(solve_module, "decode_capture", decode)
    monkeypatch.setattr(solve_module, "observe_board", observe)


@pytest.mark.usefixtures("seen")
def test_captures_give_the_same_rig_as_their_views(rig: Rig) -> None:
    names = ["pose_0", "dark", "pose_1", "pose_2", "wall", "pose_3", "pose_4"]
    found = calibrate_captures((capture(name) for name in names), BOARD)
    np.testing.assert_allclose(found.camera.lens.vector, rig.camera.lens.vector, rtol=1e-6)
    failed = found.further["calibration"]["failed_captures"]
    assert failed == [
        {"name": "dark", "reason": "no pixel is valid along x"},
        {"name": "wall", "reason": "no board of 11 x 8 inner corners was found"},
    ]


@pytest.mark.usefixtures("seen")
def test_one_capture_in_memory_at_a_time() -> None:
    alive: list[weakref.ref[NDArray[np.uint8]]] = []

    def captures() -> Iterator[Capture]:
        for name in ("pose_0", "pose_1", "pose_2", "pose_3"):
            gc.collect()
            assert all(reference() is None for reference in alive)
            item = capture(name)
            alive.append(weakref.ref(item.frames[0]))  # type: ignore[arg-type]
            yield item
            del item

    calibrate_captures(captures(), BOARD)
    assert len(alive) == 4


@pytest.mark.usefixtures("seen")
def test_too_few_captures_list_their_failures() -> None:
    names = ["pose_0", "dark", "wall", "pose_1"]
    with pytest.raises(CalibrationError, match="2 can be used") as error:
        calibrate_captures(map(capture, names), BOARD)
    assert "dark: no pixel is valid along x" in str(error.value)
    assert "wall: no board of 11 x 8" in str(error.value)


def test_no_captures() -> None:
    with pytest.raises(CalibrationError, match="no captures"):
        calibrate_captures([], BOARD)


@pytest.mark.usefixtures("seen")
@pytest.mark.parametrize(
    ("other", "message"),
    [
        (capture("b", width=640), "b: the camera's image is 640 x 480, .* 752 x 480"),
        (capture("b", projector=1024), "b: the projector's image is 1024 x 684, .* 608 x 684"),
    ],
)
def test_captures_of_different_sizes(other: Capture, message: str) -> None:
    with pytest.raises(CalibrationError, match=message):
        calibrate_captures([capture("pose_0"), other], BOARD)
