"""What planes cannot tell of the paper's ten parameters: rank, null directions."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from fringeworks.calibrate.extended.fit import fit_extended
from fringeworks.model import Axis, Extended, Rig
from tests.calibrate.plane_points import (
    DISTORTED,
    PINHOLE,
    PURE_X,
    PURE_Y,
    P,
    apart,
    depths,
    points_of,
)


@pytest.mark.parametrize(
    ("rig", "axis", "rank"),
    [
        (PINHOLE, "x", 7),
        (DISTORTED, "x", 7),
        (apart(PINHOLE, 1973.0), "x", 8),
        (apart(PINHOLE, 1974.01), "x", 8),
        (PURE_Y, "x", 6),
        (apart(PURE_Y, 1900.0), "x", 6),  # fy does not count: the turn leaves y alone
        (PINHOLE, "y", 7),
        (PURE_X, "y", 6),
    ],
)
def test_the_rank_is_the_algebras(rig: Rig, axis: Axis, rank: int) -> None:
    fit = fit_extended(points_of(rig, axis=axis), rig, axis=axis, period_px=P, noise_mm=0.1)
    assert fit.degeneracy.rank == rank
    assert len(fit.degeneracy.nulls) == 10 - rank
    assert fit.degeneracy.usable <= rank
    assert 3 < fit.effective_dof <= rank + 1e-6


def at(values: Mapping[str, float]) -> Extended:
    ten = np.array([values.get(name, 0.0) for name in Extended.NAMES])
    return Extended.from_vector(ten, axis="x", period_px=P)


def test_null_directions_change_no_depth() -> None:
    """Those of Ku0 and Kv0 at any length; that of Kfc is exact only at its start, so that a tenth
    of a prior sigma, 0.5 of 1974 px, may leave (0.5 / 1974)^2 of 660 mm: 0.04 um."""
    points, start = points_of(PINHOLE), Extended("x", P)
    nulls = fit_extended(points, PINHOLE, axis="x", period_px=P, noise_mm=0.1).degeneracy.nulls
    assert [next(iter(null)) for null in nulls] == ["Ku0", "Kv0", "Kfc"]
    before = depths(points, PINHOLE, start)
    for null, times in zip(nulls, (3.0, 3.0, 0.1), strict=True):
        moved = at({name: times * value for name, value in null.items()})
        assert np.abs(depths(points, PINHOLE, moved) - before).max() < 1e-3
        without = at({n: times * value for n, value in null.items() if n != next(iter(null))})
        assert np.abs(depths(points, PINHOLE, without) - before).max() > 0.01


def test_a_rig_moved_along_all_null_directions_at_once_has_the_same_depths() -> None:
    """In closed form, by as much as the paper's own parameters: C and D are scaled by s =
    f / (f + Kfc) and moved by r Ku0 / (f + Kfc), which C1 to C4 undo."""
    points, f = points_of(PINHOLE), PINHOLE.camera.lens.fx
    ku0, kv0, kfc = 17.9, -12.0, -6.975
    s, (along, _, ahead) = f / (f + kfc), PINHOLE.projector_from_camera.rotation
    tx, _, tz = -PINHOLE.projector_from_camera.translation_mm
    shift = np.array([ku0, kv0]) / (f + kfc)
    moved = Extended(
        "x",
        P,
        C1=(s - 1) * tx,
        C2=(s - 1) * tz,
        C3=(s - 1) * along[2] - along[:2] @ shift,
        C4=(s - 1) * ahead[2] - ahead[:2] @ shift,
        Ku0=ku0,
        Kv0=kv0,
        Kfc=kfc,
    )
    change = depths(points, PINHOLE, moved) - depths(points, PINHOLE, Extended("x", P))
    assert np.abs(change).max() < 1e-9
