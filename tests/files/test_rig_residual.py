"""Residual fields in ``rig.json``: kept as they are, refused where they cannot be evaluated."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from fringeworks.errors import FormatError
from fringeworks.files import read_rig, write_rig
from fringeworks.model import AXES, ResidualField
from tests.scenes import RIG

FIELD = {
    "model": "full",
    "axis": "x",
    "order": 1,
    "middle": [80.0, 0.6, 0.02],
    "low": [0, 0, -60.0],
    "high": [751, 479, 60.0],
    "coefficients": [0.1, -0.2, 1 / 3, 0.0],
    "gain": 0.4,
    "gain_sigma": 0.05,
}


def test_they_are_kept(tmp_path: Path) -> None:
    field = ResidualField(
        "full",
        "x",
        1,
        (80.0, 0.6, 0.02),
        (0.0, 0.0, -60.0),
        (751.0, 479.0, 60.0),
        coefficients=(0.1, 1 / 3, -2.5, 0.0),
        gain=0.4,
        gain_sigma=0.05,
    )
    fields = tuple(replace(field, axis=axis) for axis in AXES)
    write_rig(tmp_path / "rig.json", replace(RIG, residual=fields))
    assert read_rig(tmp_path / "rig.json").residual == fields


def test_a_rig_without_one_has_no_such_key(tmp_path: Path) -> None:
    write_rig(tmp_path / "rig.json", RIG)
    assert "residual" not in json.loads((tmp_path / "rig.json").read_text())
    assert read_rig(tmp_path / "rig.json").residual == ()


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ([{"model": "full"}], r"residual\[0\].axis is missing"),
        ([FIELD | {"model": "best"}], r"residual\[0\].model must be 'geometric'"),
        ([FIELD | {"order": 0}], r"residual\[0\].order must be >= 1, got 0"),
        ([FIELD | {"order": 2}], r"coefficients must be 10 for order 2, got 4"),
        ([FIELD | {"high": [751, 0, 60.0]}], r"residual\[0\].high must be > low, each"),
        ([FIELD | {"gain_sigma": -1.0}], r"residual\[0\].gain_sigma must be >= 0, got -1.0"),
        ([FIELD, FIELD], r"residual\[1\] is a second field of the full model along x"),
    ],
)
def test_a_damaged_one_is_refused(
    tmp_path: Path, fields: list[dict[str, Any]], message: str
) -> None:
    path = tmp_path / "rig.json"
    write_rig(path, RIG)
    path.write_text(json.dumps(json.loads(path.read_text()) | {"residual": fields}))
    with pytest.raises(FormatError, match=message):
        read_rig(path)
