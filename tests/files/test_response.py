"""``response.json``: what is written reads back, and what is wrong is named."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fringeworks.errors import FormatError
from fringeworks.files import read_response, read_rig, write_response, write_rig
from fringeworks.files.response import describe_response, response_of_rig, rig_with_response
from fringeworks.model import Fringe, GreyCurve, ImageExponent, PhaseTerms, RegionCurve, Response
from fringeworks.phase.response import find_terms
from tests.scenes import RIG

CURVE = GreyCurve(
    levels=(0.0, 0.3, 1.0),
    light=(0.0, 0.1, 1.0),
    harmonics=(0.28, 0.01),
    left=(-1e-4, 2e-4),
    regions=(RegionCurve((0, 10), (5, 20), (0.0, 0.11, 1.0)),),
)
TERMS = PhaseTerms(
    axis="y",
    period_px=66.66666666666667,
    shifts_rad=(2.0943951023931953, 0.0, -2.0943951023931953),
    cos=(0.01, -0.001),
    sin=(-0.25, 0.02),
    before=4.2,
    after=0.4,
    unit="px",
)
RESPONSES = [
    Response("levels", "levels of the lab", CURVE, 608, 684),
    Response("gray", "plane, group a", ImageExponent(0.145, 0.194, 0.03), 1920, 1080),
    Response("periods", "mugs", (TERMS, TERMS), 1920, 1080, "the response of levels"),
]


@pytest.mark.parametrize("response", RESPONSES, ids=lambda item: item.way)
def test_reads_back(response: Response, tmp_path: Path) -> None:
    write_response(tmp_path / "response.json", response)
    assert read_response(tmp_path / "response.json") == response


@pytest.mark.parametrize("response", RESPONSES, ids=lambda item: item.way)
def test_a_rig_keeps_it(response: Response, tmp_path: Path) -> None:
    assert response_of_rig(RIG) is None
    write_rig(tmp_path / "rig.json", rig_with_response(RIG, response))
    assert response_of_rig(read_rig(tmp_path / "rig.json")) == response


def spoil(document: dict[str, Any], place: tuple[Any, ...], value: Any) -> None:
    for part in place[:-1]:
        document = document[part]
    document[place[-1]] = value


@pytest.mark.parametrize(
    ("response", "place", "value", "words"),
    [
        (RESPONSES[0], ("curve", "levels"), [0, 0.3, 0.9], "curve.levels must rise from 0 to 1"),
        (RESPONSES[0], ("curve", "levels"), [0.0, 0.0, 1.0], "curve.levels must rise from 0 to 1"),
        (RESPONSES[0], ("curve", "light"), [0.0, 0.5, 0.4], "from 0 to 1 and never fall"),
        (RESPONSES[0], ("curve", "light"), [0.1, 0.5, 1.0], "from 0 to 1 and never fall"),
        (RESPONSES[0], ("curve", "regions", 0, "light"), [0.0, 0.5, 0.9], "from 0 to 1"),
        (RESPONSES[0], ("curve", "levels"), [0.0, 5e-324, 1.0], "by 1e-06 or more"),
        (RESPONSES[0], ("curve", "levels"), [0.0] * 5000, "curve.levels"),
        (RESPONSES[0], ("projector", "width"), 0, "projector.width must be >= 1"),
        (RESPONSES[0], ("curve", "light"), [0.0, 1.0], "as many values as curve.levels"),
        (RESPONSES[0], ("exponent",), {"exponent": 2.0}, "before_rad is missing"),
        (RESPONSES[1], ("exponent", "exponent"), 0.0, "exponent.exponent must be > 0"),
        (RESPONSES[1], ("exponent",), None, "one of curve, exponent and terms, got 0"),
        (RESPONSES[2], ("terms", 0, "sin_rad"), [0.1], "as many cos_rad as sin_rad"),
        (RESPONSES[2], ("terms", 1, "sin_rad"), [7.0, 0.0], "sin_rad"),
        (RESPONSES[2], ("terms", 1, "sin_rad"), [3.0, 0.0], "must not fold the phase over"),
        (RESPONSES[2], ("terms", 1, "curve"), [3.0, 0.0], "unknown key 'terms[1].curve'"),
        (RESPONSES[2], ("format",), "fringeworks-rig/1", "format must be 'fringeworks-response/1'"),
    ],
)
def test_what_is_wrong_is_named(
    response: Response, place: tuple[Any, ...], value: Any, words: str, tmp_path: Path
) -> None:
    path = tmp_path / "response.json"
    write_response(path, response)
    document = json.loads(path.read_text())
    spoil(document, place, value)
    path.write_text(json.dumps(document))
    with pytest.raises(FormatError) as raised:
        read_response(path)
    assert words in str(raised.value)
    assert str(path) in str(raised.value)


@st.composite
def curves(draw: st.DrawFn) -> GreyCurve:
    """Levels apart by a whole one of 16 bits or more, and light between black and white."""
    inner = sorted(draw(st.sets(st.integers(1, 65_534), max_size=8)))
    light = sorted(draw(st.lists(st.floats(0, 1), min_size=len(inner), max_size=len(inner))))
    return GreyCurve(tuple(n / 65_535 for n in (0, *inner, 65_535)), (0.0, *light, 1.0))


@given(curve=curves(), source=st.text(), bent=st.none() | st.text())
def test_any_curve_reads_back(curve: GreyCurve, source: str, bent: str | None) -> None:
    """And it bends patterns: each light has a level, and more light no lower one."""
    response = Response("levels", source, curve, 608, 684, bent)
    assert read_text_of(json.dumps(describe_response(response))) == response
    levels = curve.level_of(np.linspace(0, 1, 65))
    assert (np.diff(levels) >= 0).all()
    assert levels.min() >= 0
    assert levels.max() <= 1


def places_of(value: Any) -> Iterator[tuple[Any, ...]]:
    """Every place of a document."""
    items = value.items() if isinstance(value, dict) else enumerate(value)
    for key, item in items:
        yield (key,)
        if isinstance(item, dict | list):
            yield from ((key, *rest) for rest in places_of(item))


ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner),
    max_leaves=6,
)


@given(data=st.data(), response=st.sampled_from(RESPONSES), value=ANYTHING)
def test_anything_anywhere_is_read_or_named(
    data: st.DataObject, response: Response, value: Any
) -> None:
    """And what is read can be applied."""
    document = json.loads(json.dumps(describe_response(response)))
    spoil(document, data.draw(st.sampled_from(list(places_of(document)))), value)
    try:
        read = read_text_of(json.dumps(document))
    except FormatError:
        return
    terms = find_terms(read, Fringe("x", 32.0, TERMS.shifts_rad))
    found = terms.error_at(np.linspace(-3, 3, 9))[0] if terms is not None else np.zeros(1)
    assert np.isfinite(found).all()


def read_text_of(text: str) -> Response:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "response.json"
        path.write_text(text)
        return read_response(path)
