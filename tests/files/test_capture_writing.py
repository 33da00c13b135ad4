"""What is written reads back as it was."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fringeworks import model
from fringeworks.errors import FormatError, ShapeError, UsageError
from fringeworks.files import capture_writing, read_capture, write_capture, write_sequence
from fringeworks.files.capture_writing import describe_capture
from fringeworks.model import Capture, Fringe, GrayCode, PatternSet, Sensor, Uniform
from fringeworks.model.capture import to_grey
from tests.files.folders import HEIGHT, WIDTH, make_capture, pixels

Item = TypeVar("Item")

MESSAGES = (
    FormatError,
    UsageError,
)


def capture_of(sets: tuple[PatternSet, ...], **changes: Any) -> Capture:
    frames = tuple(
        pixels(str(index), shape=(item.image_count, HEIGHT, WIDTH))
        for index, item in enumerate(sets)
    )
    given = {"sequence": model.Sequence(608, 684, sets), "frames": frames, "sensor": Sensor(255.0)}
    return Capture(**{**given, **changes})


def steps(count: int) -> tuple[float, ...]:
    return tuple(2 * math.pi * i / count for i in range(count))


FRINGES = PatternSet(Fringe("x", 32.0, steps(3)))
WHITE = PatternSet(Uniform(1.0))


def assert_same(one: Capture, other: Capture) -> None:
    assert one.sequence == other.sequence
    assert one.sensor == other.sensor
    assert one.provenance == other.provenance
    for stack, again in zip(one.frames, other.frames, strict=True):
        np.testing.assert_array_equal(stack, again)
        assert stack.dtype == again.dtype


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_a_capture_that_was_read_is_written_the_same(
    tmp_path: Path, dtype: type[np.generic]
) -> None:
    capture = read_capture(make_capture(tmp_path / "a", dtype=dtype))
    assert write_capture(capture, tmp_path / "b") == tmp_path / "b" / "capture.toml"
    again = read_capture(tmp_path / "b")
    assert_same(capture, again)
    assert again.name == "b"


def test_groups_exposures_repeats_and_times(tmp_path: Path) -> None:
    sets = (
        PatternSet(Fringe("x", 32.0, steps(4)), group="a", exposure_ms=10.0, repeats=2),
        PatternSet(
            GrayCode("y", 5, 32.0, inverted=True, complementary=True),
            timestamps_s=tuple(i / 7 for i in range(11)),
        ),
        PatternSet(GrayCode("x", 5, 32.0, complementary=True), repeats=3),
    )
    capture = capture_of(sets, provenance={"note": "π", "nested": {"list": [1.5, "x", True]}})
    write_capture(capture, tmp_path)
    assert_same(read_capture(tmp_path, group="a"), capture)


def test_shifts_in_the_file_are_the_numbers_one_would_write(tmp_path: Path) -> None:
    text = describe_capture(model.Sequence(608, 684, (FRINGES,)))
    assert "shifts_deg = [0.0, 120.0, 240.0]" in text
    assert 'images = ["fringe_x_p32_0.png", "fringe_x_p32_1.png", "fringe_x_p32_2.png"]' in text


def test_the_white_frame_is_written_in_colour(tmp_path: Path) -> None:
    colour = pixels("colour", shape=(HEIGHT, WIDTH, 3))
    capture = capture_of(
        (PatternSet(Uniform(0.0)), WHITE),
        frames=(pixels("black", shape=(1, HEIGHT, WIDTH)), to_grey(colour)[None]),
        colour=colour,
    )
    write_capture(capture, tmp_path)
    again = read_capture(tmp_path)
    assert_same(again, capture)
    assert again.colour is not None
    np.testing.assert_array_equal(again.colour, colour)


def test_colour_sets_and_black_are_written_in_colour(tmp_path: Path) -> None:
    black, white = (pixels(name, shape=(HEIGHT, WIDTH, 3)) for name in ("black", "white"))
    painted = PatternSet(model.Colour("x", 32.0, ("red", "green")), repeats=2)
    capture = capture_of(
        (PatternSet(Uniform(0.0)), WHITE, painted),
        frames=(
            to_grey(black)[None],
            to_grey(white)[None],
            pixels("painted", shape=(2, HEIGHT, WIDTH, 3)),
        ),
        colour=white,
        dark_colour=black,
    )
    write_capture(capture, tmp_path)
    again = read_capture(tmp_path)
    assert_same(again, capture)
    assert again.dark_colour is not None
    np.testing.assert_array_equal(again.dark_colour, black)


@pytest.mark.parametrize("level", [0.0, 0.5])
def test_colour_without_a_white_set_is_put_nowhere(tmp_path: Path, level: float) -> None:
    grey = PatternSet(Uniform(level))
    capture = capture_of((grey,), colour=pixels("colour", shape=(HEIGHT, WIDTH, 3)))
    write_capture(capture, tmp_path)
    again = read_capture(tmp_path)
    np.testing.assert_array_equal(again.frames[0], capture.frames[0])
    assert again.colour is None


@pytest.mark.parametrize(
    ("stacks", "message"),
    [
        ([3], "stacks must hold one per set, 2, got 1"),
        ([3, 1, 1], "stacks must hold one per set, 2, got more"),
        ([2, 1], "stack 1 must hold 3 images, got 2"),
        ([3, 2], "stack 2 must hold 1 images, got 2"),
    ],
)
def test_stacks_must_be_those_of_the_sets(tmp_path: Path, stacks: list[int], message: str) -> None:
    sequence = model.Sequence(608, 684, (FRINGES, WHITE))
    images = (pixels("any", shape=(count, HEIGHT, WIDTH)) for count in stacks)
    with pytest.raises(ShapeError, match=f"^{message}$"):
        write_sequence(sequence, (list(stack) for stack in images), tmp_path)
    assert not (tmp_path / "capture.toml").exists()


def test_a_capture_is_only_replaced_when_asked(tmp_path: Path) -> None:
    write_capture(capture_of((FRINGES,)), tmp_path)
    with pytest.raises(UsageError, match="holds a capture already; choose another folder"):
        write_capture(capture_of((WHITE,)), tmp_path)
    assert read_capture(tmp_path).sequence.sets == (FRINGES,)
    write_capture(capture_of((WHITE,)), tmp_path, overwrite=True)
    assert read_capture(tmp_path).sequence.sets == (WHITE,)


def test_half_a_capture_is_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_capture(capture_of((FRINGES,)), tmp_path)
    written: list[Path] = []

    def fail(path: Path, image: object) -> None:
        written.append(path)
        if len(written) == 2:
            raise FormatError("disk full")

    monkeypatch.setattr(capture_writing, "write_image", fail)
    with pytest.raises(FormatError, match="disk full"):
        write_capture(capture_of((FRINGES,)), tmp_path, overwrite=True)
    assert not (tmp_path / "capture.toml").exists()


@pytest.mark.parametrize(
    ("item", "message"),
    [
        (
            PatternSet(Fringe("x", 32.0, steps(2))),
            "shifts must be three at least .* 2: 0, 180",
        ),
        (PatternSet(Fringe("x", 1.0, steps(3))), r"set 1 \(fringe\): period_px must be >= 2"),
        (PatternSet(GrayCode("x", 3, 32.0)), "bits must be 5 to 16 for 608 px"),
        (PatternSet(Uniform(math.nan)), r"level must be a finite number|level must be"),
    ],
)
def test_what_could_not_be_read_is_not_written(
    tmp_path: Path, item: PatternSet, message: str
) -> None:
    with pytest.raises(UsageError, match=message):
        write_capture(capture_of((item,)), tmp_path / "new")
    assert not (tmp_path / "new").exists()


def test_a_provenance_that_toml_cannot_hold(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="cannot be written as TOML"):
        write_capture(capture_of((WHITE,), provenance={"a": object()}), tmp_path)


def test_progress_sees_every_set(tmp_path: Path) -> None:
    seen = []

    class Shown:
        def __call__(self, items: Sequence[Item], description: str) -> Iterable[Item]:
            for item in items:
                seen.append(description)
                yield item

    write_capture(capture_of((FRINGES, WHITE)), tmp_path, progress=Shown())
    assert seen == ["writing images"] * 2


axes = st.sampled_from(model.AXES)
periods = st.floats(2, 1000)
even = st.integers(1, 500).map(lambda half: 2.0 * half)
colours = st.sampled_from(["red", "#0080ff", "White"])
zeros = st.floats(-100, 100)
fringes = st.builds(
    lambda axis, period, start, count, zero: Fringe(
        axis, period, tuple(start + shift for shift in steps(count)), zero
    ),
    axes,
    periods,
    st.floats(-math.pi, math.pi),
    st.integers(3, 9),
    zeros,
)
codes = st.builds(
    GrayCode, axes, st.integers(10, 12), st.integers(1, 700).map(float), inverted=st.booleans()
)
others = st.one_of(
    st.builds(Uniform, st.floats(0, 1)),
    st.builds(model.Checkerboard, st.floats(0.5, 100)),
    st.builds(model.Staircase, axes, even, st.integers(350, 999), st.integers(3, 6).map(steps)),
    st.builds(model.Colour, axes, even, st.lists(colours, min_size=1).map(tuple)),
    st.builds(model.Speckle, st.integers(0, 2**60), st.floats(0.5, 100)),
    st.builds(model.Picture, st.integers(1, 4)),
)
pattern_sets = st.builds(
    PatternSet,
    st.one_of(fringes, codes, others),
    exposure_ms=st.none() | st.floats(1e-3, 1e4),
    repeats=st.integers(1, 3),
)


def _code(item: PatternSet) -> object:
    """What no two sets of a group may share."""
    pattern = item.pattern
    return (pattern.axis, pattern.cell_px) if isinstance(pattern, GrayCode) else object()


@settings(max_examples=80)
@given(
    st.lists(pattern_sets, min_size=1, max_size=4, unique_by=_code).map(tuple),
    st.floats(1e-3, 255),
)
def test_any_description_reads_back(sets: tuple[PatternSet, ...], gain: float) -> None:
    """Every number exactly, but shifts: those to two units in the last place of their radians."""
    import tomllib

    from fringeworks.files.capture import describe_sequence, parse_capture

    sequence = model.Sequence(608, 684, sets)
    text = describe_capture(sequence, sensor=Sensor(255.0, gain=gain))
    file = parse_capture(tomllib.loads(text), Path("capture.toml"))
    assert file.camera.sensor(0.0) == Sensor(255.0, gain=gain)
    for item, again in zip(sets, describe_sequence(file).sets, strict=True):
        one, other = (_split_shifts(each.pattern) for each in (item, again))
        assert one[0] == other[0]
        np.testing.assert_allclose(other[1], one[1], rtol=4.5e-16, atol=1e-300)
        assert (item.exposure_ms, item.repeats) == (again.exposure_ms, again.repeats)


def _split_shifts(pattern: model.Pattern) -> tuple[object, tuple[float, ...]]:
    """A pattern as type and fields without shifts, and the shifts."""
    from dataclasses import asdict

    fields = asdict(pattern)
    shifts = fields.pop("shifts_rad", ())
    return (type(pattern), fields), shifts


def _coded_place(item: PatternSet) -> object:
    """What only one Gray code of a capture may have; each of the other sets has its own."""
    code = item.pattern
    return (code.axis, code.cell_px) if isinstance(code, GrayCode) else object()


@settings(max_examples=15, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(sets=st.lists(pattern_sets, min_size=1, max_size=3, unique_by=_coded_place).map(tuple))
def test_any_capture_reads_back(tmp_path: Path, sets: tuple[PatternSet, ...]) -> None:
    capture = capture_of(sets)
    write_capture(capture, tmp_path, overwrite=True)
    again = read_capture(tmp_path)
    for stack, other in zip(capture.frames, again.frames, strict=True):
        np.testing.assert_array_equal(stack, other)
