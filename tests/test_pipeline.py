"""The whole line on the real full-size capture, against the board's true size."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fringeworks.calibrate import calibrate_captures
from fringeworks.errors import ShapeError
from fringeworks.files import read_board, read_capture
from fringeworks.model import Axis, Rig, Target
from fringeworks.phase.decode import decode_capture
from fringeworks.pipeline import measure_board, measure_plane, scan
from fringeworks.reconstruct.full import CloudRules, triangulate

POSES = [f"capture_{pose}" for pose in range(4)]


@pytest.fixture(scope="module")
def calibrated(real: Callable[[str], Path]) -> tuple[Path, Target, Rig]:
    folder = real("procam-graycode")
    board = read_board(folder / "board.toml")
    captures = (read_capture(folder / pose) for pose in POSES)
    return folder, board, calibrate_captures(captures, board)


@pytest.mark.parametrize("pose", POSES)
def test_each_board_comes_out_square_and_flat(
    calibrated: tuple[Path, Target, Rig], pose: str
) -> None:
    """Every point inside the corners counts; a Gray cell is worth 1.2 to 2.8 mm rms here."""
    folder, board, rig = calibrated
    cloud = scan(read_capture(folder / pose), rig)
    measured = measure_board(cloud, rig, board, view=pose)
    assert measured is not None
    spacing, plane = measured
    assert spacing.mean_mm == pytest.approx(75.0, abs=0.2)
    assert plane.fit.form_rms_mm <= 3.2
    assert plane.fit.form_rms_mm == pytest.approx(plane.predicted_rms_mm, rel=0.1)
    assert len(plane.fit.deviations_mm) > 80_000


@pytest.mark.parametrize("axis", ["x", "y", None])
def test_the_table_gives_the_full_models_points(
    calibrated: tuple[Path, Target, Rig], axis: Axis | None
) -> None:
    """To 1 um; a point as near as that to an end of the depth range may be on either side of it."""
    folder, _, rig = calibrated
    rules, ends = CloudRules(axis=axis, edges=None), rig.z_window()
    seen = decode_capture(read_capture(folder / POSES[0]))
    table = triangulate(seen, rig, rules=rules)
    exact = triangulate(seen, rig, rules=replace(rules, exact=True))
    np.testing.assert_allclose(
        table.xyz[table.valid & exact.valid], exact.xyz[table.valid & exact.valid], atol=1e-3
    )
    apart = np.nonzero(table.valid != exact.valid)
    depths = np.fmax(table.xyz[apart][:, 2], exact.xyz[apart][:, 2])
    assert ends is not None
    assert all(min(abs(depth - end) for end in ends) < 1e-3 for depth in depths)


def test_a_view_that_the_rig_does_not_know_has_no_board(
    calibrated: tuple[Path, Target, Rig],
) -> None:
    folder, board, rig = calibrated
    cloud = scan(read_capture(folder / POSES[0]), rig)
    assert measure_board(cloud, rig, board, view="elsewhere") is None
    assert measure_plane(cloud).form_rms_mm > 3.2  # wall and board together are no plane


def test_a_rig_with_another_projector_is_refused(
    calibrated: tuple[Path, Target, Rig],
) -> None:
    folder, _, rig = calibrated
    other = replace(rig, projector=replace(rig.projector, width=1920, height=1080))
    with pytest.raises(ShapeError, match="must be 1920x1080 like the rig's, got 1024x768"):
        scan(read_capture(folder / POSES[0]), other)
