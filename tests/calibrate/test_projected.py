"""Paper mode: projected corners beside the twin's truth, the solution beside OpenCV's own chain."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.calibrate import CalibrationSettings, ImageSize, calibrate_paper
from fringeworks.calibrate.held.verify import verify_view
from fringeworks.calibrate.projected.camera import KEPT_PX, PosedView
from fringeworks.calibrate.projected.fit import PaperFit, fit_paper
from fringeworks.calibrate.projected.record import model_of, paper_figures, rig_of
from fringeworks.calibrate.projected.solve import observe_projected
from fringeworks.calibrate.record import read_record
from fringeworks.errors import CalibrationError
from fringeworks.files import read_rig, write_rig
from fringeworks.geometry.align import align_points
from fringeworks.geometry.lens import project
from fringeworks.model import (
    Capture,
    Checkerboard,
    CheckerboardTarget,
    Lens,
    PatternSet,
    Pose,
    Rig,
    Uniform,
)
from fringeworks.twin.scenes import BOARD as PRINTED
from fringeworks.twin.scenes import board_scene, paper_rig, target_of
from tests.calibrate.projected_views import (
    SHOWN_POSES,
    made_up,
    paper_captures,
    whole_capture,
    without,
)
from tests.calibrate.synthetic import (
    BOARD,
    CAMERA,
    PROJECTOR,
    RELATION,
    board_poses,
    rig_state,
    triangulate_corners,
    views_of,
)

Array = NDArray[np.float64]

SIZES = (ImageSize(752, 480), ImageSize(608, 684))
SETTINGS = CalibrationSettings()
TARGET = target_of(PRINTED)


def matrix_of(lens: Lens) -> tuple[Array, Array]:
    matrix = np.array([[lens.fx, 0, lens.cx], [0, lens.fy, lens.cy], [0, 0, 1]])
    return matrix, lens.vector[4:]


def decoded_by_opencv(rig: Rig, camera_from_board: Pose, camera_px: Array) -> Array:
    """``(n, 2)`` projector px that a board shows at camera px, by OpenCV alone."""
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 100, 1e-12)
    eye = np.eye(3)
    ideal = cv2.undistortPointsIter(
        camera_px[:, None], *matrix_of(rig.camera.lens), eye, eye, stop
    ).reshape(-1, 2)
    rays = np.column_stack([ideal, np.ones(len(ideal))])
    normal = camera_from_board.rotation[:, 2]
    depth = (normal @ camera_from_board.translation_mm) / (rays @ normal)
    turn, _ = cv2.Rodrigues(rig.projector_from_camera.rotation)
    pixels, _ = cv2.projectPoints(
        rays * depth[:, None],
        turn,
        rig.projector_from_camera.translation_mm,
        *matrix_of(rig.projector.lens),
    )
    return np.asarray(pixels.reshape(-1, 2))


def solve(views: list[PosedView], settings: CalibrationSettings = SETTINGS) -> PaperFit:
    return fit_paper(views, SIZES, settings)


def exact_views(count: int = 8) -> list[PosedView]:
    return made_up(rig_state(board_poses(count, rng=np.random.default_rng(31))))


@pytest.fixture(scope="module")
def views() -> list[PosedView]:
    return [observe_projected(capture, TARGET) for capture in paper_captures()]


class TestCorners:
    def test_they_are_where_the_twin_has_them(self, views: list[PosedView]) -> None:
        """Whitened by their own sigma (camera px, two per projector column, about one per row).

        The mean square of 400 and more scores scatters by sqrt(2 / 400) = 0.07; sigma itself is
        right to about 20 %, so that 0.6 to 1.6 are its bounds. A wrong index is 20 px off.
        """
        scores = []
        for view, place in zip(views, SHOWN_POSES, strict=True):
            found, pose = view.projected, board_scene().poses[place]
            here = decoded_by_opencv(paper_rig(), pose, found.camera_px)
            error = found.projector_px - here
            assert np.abs(error).max() < 0.2
            moved = [
                decoded_by_opencv(paper_rig(), pose, found.camera_px + step) - here
                for step in ([0.01, 0.0], [0.0, 0.01])
            ]
            by_px = np.stack(moved, axis=-1) / 0.01
            sigma = np.sqrt((by_px**2 @ (found.camera_sigma_px**2)[..., None])[..., 0])
            scores.append(error / sigma)
        every = np.concatenate(scores)
        assert len(every) > 200
        assert 0.6 < np.mean(every**2) < 1.6

    def test_no_corner_is_on_dark_print(self, views: list[PosedView]) -> None:
        """What is left lies in squares that are white, or on the sheet's margin."""
        for view, place in zip(views, SHOWN_POSES, strict=True):
            pose, lens = board_scene().poses[place], paper_rig().camera.lens
            turn, _ = cv2.Rodrigues(pose.rotation)
            middles, dark = square_middles()
            seen, _ = cv2.projectPoints(middles, turn, pose.translation_mm, *matrix_of(lens))
            away = np.linalg.norm(view.projected.camera_px[:, None] - seen.reshape(-1, 2), axis=-1)
            assert not dark[away.argmin(axis=1)].any()

    def test_a_rig_comes_out(self) -> None:
        """Points of the volume, seen by the true rig, triangulated by the one found.

        Corners of 0.02 camera px are 0.007 mm on the board, 0.02 mm in depth at 16 degrees; over
        five poses and 200 corners the field's edges are known about as well as one corner is.
        """
        rig, true = calibrate_paper(iter(paper_captures()), TARGET), paper_rig()
        x, y, z = np.meshgrid(np.linspace(-70, 70, 5), np.linspace(-45, 45, 5), [600.0, 700.0])
        points = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=-1)
        camera = project(points, true.camera.lens.vector)
        projector = project(true.projector_from_camera.apply(points), true.projector.lens.vector)
        found = triangulate_corners(rig, camera, projector)
        turn, shift = align_points(found, points)
        error = found @ turn.T + shift - points
        assert np.sqrt(np.mean(error**2)) < 0.03
        figures = paper_figures(rig.further)
        assert figures is not None
        assert figures["projected_kept"] > 0.97 * figures["projected_offered"] > 200
        assert max(figures["camera_std_px"]) < 0.01
        assert max(figures["projector_std_px"]) < 0.03


def square_middles() -> tuple[Array, NDArray[np.bool_]]:
    """Middles of the printed squares, mm, margin's too, and which of them are dark."""
    column, row = np.meshgrid(np.arange(-2, 12), np.arange(-2, 9))
    middles = np.stack([column + 0.5, row + 0.5, 0 * row], axis=-1).reshape(-1, 3) * 13.0
    printed = (column >= -1) & (column < 11) & (row >= -1) & (row < 8)
    return middles, (printed & ((column + row) % 2 == 0)).ravel()


class TestWholeBoardInView:
    def test_without_a_code_all_of_it_tells_which_is_which(self) -> None:
        capture, rig, scene = whole_capture()
        view = observe_projected(capture, CheckerboardTarget(5, 4, 13.0, 13.0))
        pose = scene.objects[0].camera_from_object
        here = decoded_by_opencv(rig, pose, view.projected.camera_px)
        assert len(here) > 20
        assert np.abs(here - view.projected.projector_px).max() < 0.2

    def test_a_camera_upside_down(self) -> None:
        """8 x 7 inner corners do not look alike after half a turn: black and white change."""
        capture, rig, scene = whole_capture()
        turned = replace(capture, frames=tuple(stack[:, ::-1, ::-1] for stack in capture.frames))
        view = observe_projected(turned, CheckerboardTarget(5, 4, 13.0, 13.0))
        height, width = capture.shape
        at = np.array([width - 1, height - 1]) - view.projected.camera_px
        here = decoded_by_opencv(rig, scene.objects[0].camera_from_object, at)
        assert np.abs(here - view.projected.projector_px).max() < 0.2

    def test_a_part_of_it_does_not(self) -> None:
        capture = without(paper_captures()[0], keep=(2, 3, 4))
        message = "does not code both axes .* the whole projected checkerboard, 30 x 34 inner"
        with pytest.raises(CalibrationError, match=message):
            observe_projected(capture, TARGET)


def described(capture: Capture, pattern: Checkerboard | Uniform) -> Capture:
    """With another description of the checkerboard's frame."""
    sets = list(capture.sequence.sets)
    sets[2] = PatternSet(pattern)
    return replace(capture, sequence=replace(capture.sequence, sets=tuple(sets)))


class TestRefused:
    def test_no_projected_checkerboard(self) -> None:
        capture = without(paper_captures()[0], keep=(0, 1, 3, 4))
        message = "pose_01: no projected checkerboard.*paper-calibrate.*kind checkerboard.*joint"
        with pytest.raises(CalibrationError, match=message):
            observe_projected(capture, TARGET)

    def test_no_white_frame(self) -> None:
        capture = without(paper_captures()[0], keep=(0, 1, 2, 4))
        with pytest.raises(CalibrationError, match=r"pose_01: no white frame.*level 1"):
            observe_projected(capture, TARGET)

    def test_another_printed_board(self) -> None:
        other = CheckerboardTarget(9, 6, 13.0, 13.0)
        with pytest.raises(CalibrationError, match="pose_01: no board of 9 x 6 inner corners"):
            observe_projected(paper_captures()[0], other)

    @pytest.mark.parametrize("square_px", [19.0, 40.0])
    def test_squares_of_another_size(self, square_px: float) -> None:
        capture = described(paper_captures()[0], Checkerboard(square_px))
        message = f"a checkerboard of {square_px:g} px has them: is square_px in capture.toml right"
        with pytest.raises(CalibrationError, match=message):
            observe_projected(capture, TARGET)

    def test_squares_too_large_to_fix_anything(self) -> None:
        capture = described(paper_captures()[0], Checkerboard(304.0))
        with pytest.raises(CalibrationError, match="has 1 x 2 inner corners in all, at least 8"):
            observe_projected(capture, TARGET)

    def test_black_and_white_exchanged(self) -> None:
        capture = paper_captures()[0]
        frames = list(capture.frames)
        frames[2] = frames[3] + frames[4] - np.minimum(frames[2], frames[3])
        inverse = replace(capture, frames=tuple(frames))
        with pytest.raises(CalibrationError, match="is the image's first square black"):
            observe_projected(inverse, TARGET)

    def test_fewer_than_three_views(self) -> None:
        """Those that fail are told with their reasons."""
        captures = [*paper_captures()[:2], without(paper_captures()[2], keep=(0, 1, 3, 4))]
        with pytest.raises(CalibrationError, match=r"3 views .* 2 can be used") as caught:
            calibrate_paper(captures, TARGET)
        assert "pose_05: no projected checkerboard" in str(caught.value)

    def test_no_captures(self) -> None:
        with pytest.raises(CalibrationError, match="no captures"):
            calibrate_paper([], TARGET)


class TestSolution:
    def test_exact_corners_give_the_rig(self) -> None:
        """OpenCV takes float32: pixels to 3e-5, of which 700 corners leave 1e-3 px of a focal.

        The projector's principal point, 720 px down, lies outside its 684 rows.
        """
        fit = solve(exact_views())
        np.testing.assert_allclose(fit.state.camera[:4], CAMERA[:4], atol=0.01)
        np.testing.assert_allclose(fit.state.projector[:4], PROJECTOR[:4], atol=0.05)
        np.testing.assert_allclose(fit.state.projector_from_camera[3:], RELATION[3:], atol=0.01)
        np.testing.assert_allclose(fit.state.camera[4:], CAMERA[4:], atol=1e-3)
        assert fit.alone_px.max() < 1e-3

    def test_it_is_opencvs_chain(self) -> None:
        """The camera as `calibrateCamera` has it, the pose as `solvePnP` does from the same points.

        Both stop where steps are below 1e-6 or so of a parameter.
        """
        views = made_up(rig_state(board_poses(8, rng=np.random.default_rng(31))), sigma=0.05)
        fit = solve(views)
        board = [view.printed.board_mm.astype(np.float32) for view in views]
        pixels = [view.printed.camera_px.astype(np.float32) for view in views]
        flags = cv2.CALIB_FIX_K3
        stop = (3, 200, 1e-12)
        _, matrix, terms, *_ = cv2.calibrateCamera(
            board, pixels, (752, 480), np.eye(3), np.zeros(5), flags=flags, criteria=stop
        )
        found = np.concatenate([matrix[[0, 1, 0, 1], [0, 1, 2, 2]], terms.ravel()])
        np.testing.assert_allclose(fit.state.camera, found, rtol=1e-5, atol=1e-5)
        points = np.concatenate(
            [
                places @ cv2.Rodrigues(pose[:3])[0].T + pose[3:]
                for places, pose in zip(fit.projected_mm, fit.state.camera_from_board, strict=True)
            ]
        )
        there = np.concatenate([view.projected.projector_px for view in views])
        _, turn, shift = cv2.solvePnP(
            points,
            there,
            *matrix_of(Lens.from_vector(fit.state.projector)),
            RELATION[:3].copy(),
            RELATION[3:].copy(),
            useExtrinsicGuess=True,
        )
        pose = np.concatenate([turn.ravel(), shift.ravel()])
        np.testing.assert_allclose(fit.state.projector_from_camera, pose, rtol=1e-5, atol=1e-5)

    def test_terms_that_are_not_free_stay_zero(self) -> None:
        free = ("fx", "fy", "cx", "cy", "k1")
        fit = solve(exact_views(), CalibrationSettings(camera_free=free, projector_free=free))
        for lens in (fit.state.camera, fit.state.projector):
            assert lens[4] != 0
            assert not lens[5:].any()

    def test_feature_points_within_a_quarter_pixel_stay(self) -> None:
        views = exact_views()
        spoiled = views[2].printed.camera_px.copy()
        spoiled[[5, 40]] += [[0.6, 0.0], [0.0, -0.4]]
        spoiled[60] += [0.1, 0.1]
        views[2] = replace(views[2], printed=replace(views[2].printed, camera_px=spoiled))
        fit = solve(views)
        reasons = [view.printed.reasons for view in fit.views]
        assert [i for i, reason in enumerate(reasons[2]) if reason] == [5, 40]
        assert reasons[2][5] == "reprojection error above 0.25 px"
        assert Counter(reason for part in reasons for reason in part)[""] == 8 * 88 - 2
        left = np.hypot(*fit.camera_residual_px[2].T)
        assert left[5] > left[40] > KEPT_PX > left[60] > 0.1

    def test_projected_corners_far_off_are_left_out(self) -> None:
        views = made_up(rig_state(board_poses(8, rng=np.random.default_rng(31))), sigma=0.02)
        spoiled = views[3].projected.projector_px.copy()
        spoiled[7] += [0.0, 0.8]
        views[3] = replace(views[3], projected=replace(views[3].projected, projector_px=spoiled))
        fit = solve(views)
        reasons = [reason for view in fit.views for reason in view.projected.reasons]
        assert fit.views[3].projected.reasons[7] == "does not fit the other corners"
        assert len(reasons) - reasons.count("") == 1

    def test_a_view_that_keeps_too_few_is_named(self) -> None:
        views = exact_views()
        noise = np.random.default_rng(1).normal(0, 1.5, (88, 2))
        moved = replace(views[4].printed, camera_px=views[4].printed.camera_px + noise)
        views[4] = replace(views[4], printed=moved)
        message = r"pose_4: only \d of 88 printed corners are reprojected within 0.25 px"
        with pytest.raises(CalibrationError, match=message):
            solve(views)

    def test_boards_all_parallel(self) -> None:
        state = rig_state(board_poses(5, rng=np.random.default_rng(2), tilt=0.02))
        with pytest.raises(CalibrationError, match="nearly the same orientation in all 5 views"):
            solve(made_up(state))

    def test_projected_corners_of_no_lens(self) -> None:
        views = exact_views()
        rng = np.random.default_rng(3)
        for place, view in enumerate(views):
            there = rng.permutation(view.projected.projector_px)
            views[place] = replace(view, projected=replace(view.projected, projector_px=there))
        with pytest.raises(CalibrationError, match=r"candidates|mirrored"):
            solve(views)


@pytest.fixture(scope="module")
def rig() -> Rig:
    seen = made_up(rig_state(board_poses(6, rng=np.random.default_rng(7))), sigma=0.02)
    spoiled = seen[1].printed.camera_px.copy()
    spoiled[3] += [0.5, 0.5]
    seen[1] = replace(seen[1], printed=replace(seen[1].printed, camera_px=spoiled))
    return rig_of(solve(seen), SIZES, (BOARD, SETTINGS, [("pose_9", "too dark")]))


class TestRecord:
    def test_counts_and_both_rms(self, rig: Rig) -> None:
        """0.02 px each way is 0.028 px of distance; the one of 0.7 px in 528 adds 0.03."""
        quality, record = rig.quality, read_record(rig.further)
        assert quality is not None
        assert record is not None
        offered = 6 * (88 + 108) + 88
        assert (quality.observations_used, quality.observations_offered) == (offered - 89, offered)
        assert quality.camera_rms_px == pytest.approx(0.028, rel=0.1)
        assert record.rms_of_all_px[0] == pytest.approx(np.hypot(0.028, 0.7 / 528**0.5), rel=0.1)
        assert record.views[1].view.left_out == {"reprojection error above 0.25 px": 1}
        assert record.failed_captures == (("pose_9", "too dark"),)
        assert "pose_9 was not used: too dark" in str(record.findings[0])

    def test_what_the_paper_reports(self, rig: Rig) -> None:
        figures = paper_figures(rig.further)
        assert figures is not None
        assert figures["camera_std_px"] == pytest.approx([0.02, 0.02], rel=0.1)
        assert max(figures["camera_std_of_all_px"]) > 0.025
        counts = {key: figures[key] for key in figures if "kept" in key or "not" in key}
        assert counts == {
            "printed_kept": 527, "projected_kept": 648, "projected_not_found": 18
        }  # fmt: skip

    def test_it_survives_its_file(self, rig: Rig, tmp_path: Path) -> None:
        write_rig(tmp_path / "rig.json", rig)
        again = read_rig(tmp_path / "rig.json")
        assert model_of(again.further) == "paper"
        assert model_of({}) == "joint"
        assert paper_figures(again.further) == paper_figures(rig.further)
        record = read_record(again.further)
        assert record is not None
        view = record.views[0].view
        assert np.isnan(view.projector_px[:88]).all()
        assert np.isfinite(view.projector_px[88:]).all()
        assert np.isnan(record.views[0].camera_residual_px[88:]).all()

    def test_the_rig_can_be_verified(self, rig: Rig) -> None:
        """By fixed limits: no corner of the record was seen by both devices."""
        shot = views_of(rig_state(board_poses(3, rng=np.random.default_rng(50))), sigma=0.02)[0]
        found = verify_view(shot, rig, BOARD)
        assert found.holds
        assert found.limits_from.startswith("fixed")
