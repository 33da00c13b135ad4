"""The plain chain of OpenCV, on exact views and on rendered boards."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.calibrate import View
from fringeworks.errors import CalibrationError
from fringeworks.experiments.plain_chain import PlainView, calibrate_plainly, observe_plainly
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.model import (
    Axis,
    Camera,
    Capture,
    CodedAxis,
    Lens,
    PatternSet,
    Pose,
    Projector,
    ProjectorMap,
    Rig,
    Sensor,
    Sequence,
    Uniform,
)
from tests.calibrate.synthetic import (
    BOARD,
    CAMERA,
    PROJECTOR,
    RELATION,
    board_poses,
    reference,
    rig_state,
    true_corners,
    true_projector_map,
    views_of,
)

RIG = Rig(
    Camera(752, 480, Lens.from_vector(CAMERA)),
    Projector(608, 684, Lens.from_vector(PROJECTOR)),
    Pose(rotation_matrix(RELATION[:3]), RELATION[3:]),
)


def plain_view(view: View) -> PlainView:
    board, seen, shown = (
        part.astype(np.float32) for part in (view.board_mm, view.camera_px, view.projector_px)
    )
    return PlainView(board, seen, shown, offered=len(view.reasons))


def test_exact_views_give_the_rig() -> None:
    """Single precision holds pixels to 3e-5: a millionth of a focal length, amplified."""
    state = rig_state(board_poses(8, rng=np.random.default_rng(2)))
    found = calibrate_plainly([plain_view(view) for view in views_of(state)], RIG)
    assert found.quality is not None
    assert found.quality.joint_rms_px < 1e-3
    assert found.quality.observations_used == found.quality.observations_offered == 8 * 88
    np.testing.assert_allclose(found.camera.lens.vector[:4], CAMERA[:4], atol=0.05)
    np.testing.assert_allclose(found.projector.lens.vector[:4], PROJECTOR[:4], atol=0.05)
    np.testing.assert_allclose(found.projector_from_camera.translation_mm, RELATION[3:], atol=0.02)
    assert found.projector.lens.k3 == 0


def coded(values: NDArray[np.floating], axis: Axis) -> CodedAxis:
    maps = values.astype(np.float32)
    void = np.zeros(values.shape, np.uint8)
    return CodedAxis(axis, maps, maps, maps, maps, None, void, ())


def scene(*, white: bool = True) -> tuple[Capture, ProjectorMap, View]:
    """A rendered board with its exact map, and the view that says where the corners are."""
    pose, image = reference()
    maps = true_projector_map(pose)
    maps[:200] = np.nan
    level = Uniform(1.0 if white else 0.0)
    capture = Capture(Sequence(608, 684, (PatternSet(level),)), (image[np.newaxis],), Sensor(255.0))
    (view,) = views_of(rig_state(pose[np.newaxis]))
    return capture, ProjectorMap(coded(maps[..., 0], "x"), coded(maps[..., 1], "y")), view


def test_maps_are_read_at_the_corners_between_pixels() -> None:
    capture, maps, view = scene()
    plain = observe_plainly(capture, maps, view)
    true = true_corners(reference()[0])
    known = true[:, 1] > 200.5
    assert len(plain.board_mm) == known.sum() < plain.offered == BOARD.corner_count
    # noise of one grey level of 170, and what the method errs by on sharp images
    assert np.abs(plain.camera_px - true[known]).max() < 0.15
    assert np.sqrt(np.mean((plain.camera_px - true[known]) ** 2)) > 1e-3  # not handed over
    column = maps.column
    assert column is not None
    for (x, y), shown in zip(plain.camera_px, plain.projector_px, strict=True):
        i, j = int(y), int(x)
        four = column.coordinate[i : i + 2, j : j + 2].astype(float)
        a, b = four @ [1 - (x - j), x - j]
        # OpenCV cuts a pixel into 32 parts; a column is less than a projector px wide
        assert shown[0] == pytest.approx((1 - (y - i)) * a + (y - i) * b, abs=1 / 32)


def test_without_a_white_frame() -> None:
    with pytest.raises(CalibrationError, match="no white frame"):
        observe_plainly(*scene(white=False))
