"""Acceptance plans: read as written, and refused with the key that is wrong."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pytest
import tomlkit
from hypothesis import given, settings
from hypothesis import strategies as st

from fringeworks.errors import FormatError, UsageError
from fringeworks.files.acceptance import Plan, Position, read_plan, write_plan
from fringeworks.measure.acceptance import Artefacts, CalibratedLength, Form, Warmth
from fringeworks.measure.region import Region
from tests.files.spoil import spoil

WHOLE = """
format = "fringeworks-acceptance/1"
name = "the bench"
rig = "rig.json"
volume_mm = [200, 150.0, 100.0]
trim_per_mille = 2.0
temperature_c = 22.5
temperature_u95_k = 0.4

[limits]
PF_mm = 0.2
SD_mm = 0.1

[ball]
diameter_mm = 38.1
diameter_u95_mm = 0.001
form_mm = 0.002
form_u95_mm = 0.0005
cte_per_k = 1.15e-5
cte_u95_per_k = 1e-6
calibrated_at_c = 20.0

[bar]
length_mm = 120.02
length_u95_mm = 0.0015

[flat]
flatness_mm = 0.004

[[position]]
artefact = "ball"
name = "in front"
capture = "captures/one"
pixels = [[10.0, 200.0], [5.0, 150.0]]

[[position]]
artefact = "ball"
cloud = "two.npz"

[[position]]
artefact = "bar"
cloud = "bar.ply"
first = { box_mm = [[-80.0, -40.0], [-20.0, 20.0], [500.0, 560.0]] }
second = { box_mm = [[40.0, 80.0], [-20.0, 20.0], [500.0, 560.0]] }

[[position]]
artefact = "flat"
cloud = "flat.npz"
box_mm = [[-80.0, 80.0], [-20.0, 20.0], [500.0, 560.0]]
"""

PLAN = Plan(
    name="the bench",
    volume_mm=(200.0, 150.0, 100.0),
    artefacts=Artefacts(
        ball=CalibratedLength(38.1, 0.001, 1.15e-5, 1e-6),
        ball_form=Form(0.002, 0.0005),
        bar=CalibratedLength(120.02, 0.0015),
        flat=Form(0.004),
        warmth=Warmth(22.5, 0.4),
    ),
    positions=(
        Position(
            "in front",
            "ball",
            "captures/one",
            is_capture=True,
            regions=(Region(pixels=((10.0, 200.0), (5.0, 150.0))),),
        ),
        Position("ball 2", "ball", "two.npz", is_capture=False, regions=(Region(),)),
        Position(
            "bar 1",
            "bar",
            "bar.ply",
            is_capture=False,
            regions=(
                Region(box_mm=((-80.0, -40.0), (-20.0, 20.0), (500.0, 560.0))),
                Region(box_mm=((40.0, 80.0), (-20.0, 20.0), (500.0, 560.0))),
            ),
        ),
        Position(
            "flat 1",
            "flat",
            "flat.npz",
            is_capture=False,
            regions=(Region(box_mm=((-80.0, 80.0), (-20.0, 20.0), (500.0, 560.0))),),
        ),
    ),
    limits_mm={"PF": 0.2, "SD": 0.1},
    trim_per_mille=2.0,
    rig="rig.json",
)


def parse(tmp_path: Path, text: str) -> Plan:
    path = tmp_path / "plan.toml"
    path.write_text(text)
    return read_plan(path)


def changed(old: str, new: str) -> str:
    assert old in WHOLE
    return WHOLE.replace(old, new)


def test_all_of_it(tmp_path: Path) -> None:
    assert parse(tmp_path, WHOLE) == PLAN


def test_it_reads_back(tmp_path: Path) -> None:
    write_plan(tmp_path / "again.toml", PLAN)
    assert read_plan(tmp_path / "again.toml") == PLAN


def test_defaults(tmp_path: Path) -> None:
    """Without a name it has the file's, positions are counted, and three per mille may go."""
    least = """
    format = "fringeworks-acceptance/1"
    volume_mm = [1.0, 1.0, 1.0]
    flat = {}
    position = [{ artefact = "flat", cloud = "a.npz" }]
    """
    plan = parse(tmp_path, least)
    assert (plan.name, plan.trim_per_mille, plan.rig) == ("plan", 3.0, None)
    assert plan.artefacts == Artefacts(flat=Form())
    assert plan.limits_mm == {}
    assert plan.positions[0].name == "flat 1"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("trim_per_mille = 2.0", "trim_per_mille = 5.0", "trim_per_mille must be <= 3, got 5.0"),
        (
            "trim_per_mille = 2.0",
            "trim_permille = 2.0",
            "'trim_permille', did you mean 'trim_per_mille'",
        ),
        ("PF_mm = 0.2", "PFmm = 0.2", "unknown key 'limits.PFmm', did you mean 'PF_mm'"),
        ("PF_mm = 0.2", "PF_mm = 0.0", "limits.PF_mm must be > 0, got 0.0"),
        ("diameter_mm = 38.1", "", "ball.diameter_mm is missing"),
        ("[200, 150.0, 100.0]", "[200, 150.0]", "volume_mm must hold 3 entries, got 2"),
        ('artefact = "bar"', 'artefact = "barbell"', "artefact must be one of ball, bar, flat"),
        ('cloud = "bar.ply"', 'clouds = "bar.ply"', "position 3 (bar): unknown key 'clouds'"),
        ('cloud = "bar.ply"', "", "position 3 (bar): give either cloud or capture, got neither"),
        ('name = "in front"', 'cloud = "a.npz"', "position 1 (ball): give either cloud or capture"),
        ('name = "in front"', 'name = "ball 2"', "name must be no other position's, got 'ball 2'"),
        ("first = {", "first = { box = 1, ", "unknown key 'first.box', did you mean 'box_mm'"),
        ("[[10.0, 200.0], [5", "[[10.0, 1.0], [5", "pixels must hold ranges from low to high, got"),
        ("length_u95_mm = 0.0015", "length_u95_mm = 15.0", "15; is it in µm?"),
        ('"fringeworks-acceptance/1"', '"fringeworks-rig/1"', "format must be 'fringeworks-acc"),
        ('"in front"', f'"{"x" * 201}"', "name: String should have at most 200 characters"),
        ("[flat]\nflatness_mm = 0.004", "", "position 4 (flat): its certificate, the table [flat]"),
    ],
)
def test_what_is_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    with pytest.raises(FormatError) as caught:
        parse(tmp_path, changed(old, new))
    assert message in str(caught.value)
    assert str(tmp_path / "plan.toml") in str(caught.value)


def test_a_place_counts_once(tmp_path: Path) -> None:
    again = '[[position]]\nartefact = "ball"\ncloud = "two.npz"\n'
    with pytest.raises(FormatError, match=r"position 5 \(ball\): the same place as position 2"):
        parse(tmp_path, WHOLE + again)


def test_a_plan_that_could_not_be_read_is_not_written(tmp_path: Path) -> None:
    nobody = Plan("x", (1.0, 1.0, 1.0), Artefacts(), PLAN.positions)
    with pytest.raises(UsageError, match="its certificate"):
        write_plan(tmp_path / "no.toml", nobody)
    assert not list(tmp_path.iterdir())


DOCUMENT: dict[str, Any] = tomllib.loads(WHOLE)


@settings(max_examples=150)
@given(data=st.data())
def test_a_spoilt_plan_is_a_plan_or_a_format_error(
    data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    text = spoil(DOCUMENT, ["artefact", "cloud", "ball", "box_mm"], data)
    if text is None:
        return
    path = tmp_path_factory.mktemp("spoilt") / "plan.toml"
    path.write_bytes(text)
    try:
        plan = read_plan(path)
    except FormatError as error:
        assert str(path) in str(error)  # noqa: PT017 (no error is fine too)
    else:
        assert tomlkit.dumps({"n": len(plan.positions)})
