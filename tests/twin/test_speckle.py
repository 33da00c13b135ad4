"""The random-dot sensor: where dots move, by geometry alone and by OpenCV's own matching."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from fringeworks.errors import UsageError
from fringeworks.twin.scenes import cylinder_scene
from fringeworks.twin.speckle import SpeckleSensor, facing_plane, see_speckle

SENSOR = SpeckleSensor()


def test_the_sizes_are_the_kinect_s() -> None:
    rig = SENSOR.rig
    assert (rig.camera.width, rig.camera.height) == (640, 480)
    assert rig.baseline_mm == 75.0
    assert SENSOR.range_mm == (500.0, 3500.0)


def test_dots_move_by_the_baseline() -> None:
    """Between planes at 650 and 1000 mm by f b (1/650 - 1/1000) = 23.4 px, as OpenCV finds them."""
    near, far = (
        see_speckle(facing_plane(z), SENSOR, z, rng=np.random.default_rng(0))[0]
        for z in (650.0, 1000.0)
    )
    expected = 580.0 * 75.0 * (1 / 650 - 1 / 1000)
    for row, column in ((100, 200), (240, 320), (400, 500)):
        patch = far[row - 12 : row + 13, column - 12 : column + 13]
        line = near[row - 12 : row + 13, column - 12 : column + 73]
        found = cv2.matchTemplate(line, patch, cv2.TM_CCOEFF_NORMED).ravel()
        best = int(np.argmax(found))
        left, middle, right = found[best - 1 : best + 2]
        at = best + (left - right) / (2 * (left - 2 * middle + right))
        # a window of 25 px: noise and the parabola's bias are both below a tenth of a px
        assert at == pytest.approx(expected, abs=0.15)


def test_the_truth_is_what_the_camera_sees() -> None:
    _, truth = see_speckle(cylinder_scene(), SENSOR, 650.0, rng=np.random.default_rng(0))
    seen = np.isfinite(truth.xyz[..., 2])
    columns = np.nonzero(seen)[1]
    x = truth.xyz[seen][:, 0] / truth.xyz[seen][:, 2] * 580.0 + 319.5
    assert np.abs(x - columns).max() < 1e-9
    assert 640.0 < truth.xyz[seen][:, 2].min() < 650.0


@pytest.mark.parametrize("z", [499.0, 3501.0])
def test_out_of_range(z: float) -> None:
    with pytest.raises(UsageError, match="distance_mm must be 500 to 3500"):
        see_speckle(facing_plane(z), SENSOR, z, rng=np.random.default_rng(0))
