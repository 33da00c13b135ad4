"""What each preset holds, what its options change, and what is refused in which words."""

from __future__ import annotations

import itertools
import math
import re
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fringeworks.errors import UsageError
from fringeworks.model import (
    AXES,
    Checkerboard,
    Codeword,
    Colour,
    Fringe,
    GrayCode,
    Pattern,
    PatternSet,
    Sequence,
    Speckle,
    Staircase,
    Uniform,
    pixel_on_edge,
)
from fringeworks.patterns import (
    PRESETS,
    Preset,
    check_pattern,
    check_sequence,
    equal_shifts,
    explain_preset,
    frequency_ladder,
    make_sequence,
    paired_shifts,
    probe_sequence,
)

GUIDE = Path(__file__).parents[2] / "docs" / "patterns.md"


def patterns(preset: Preset, **options: Any) -> list[Pattern]:
    sequence = make_sequence(preset, **{"width": 608, "height": 684, **options})
    return [item.pattern for item in sequence.sets]


def test_paper() -> None:
    turn = 2 * math.pi / 3
    shifts = (turn, 0.0, -turn)
    assert patterns("paper") == [
        Fringe("x", 32.0, shifts),
        GrayCode("x", 5, 32.0, complementary=True),
        Fringe("y", 32.0, shifts),
        GrayCode("y", 5, 32.0, complementary=True),
        Codeword("x", 32.0, (2.0, 3.0, 4.0, 5.0, 6.0, 8.0)),
        Uniform(1.0),
        Uniform(0.0),
    ]


def test_calibrate() -> None:
    expected = [Fringe("x", 32.0, equal_shifts(8)), GrayCode("x", 5, 32.0, True, True)]
    assert patterns("calibrate")[:2] == expected


def test_measure() -> None:
    expected = [Fringe("x", 16.0, equal_shifts(8)), GrayCode("x", 6, 16.0, False, True)]
    assert patterns("measure")[:2] == expected


def test_multi_frequency() -> None:
    fringes = [p for p in patterns("multi-frequency") if isinstance(p, Fringe)]
    assert [(p.axis, p.period_px) for p in fringes] == [
        ("x", 638.4), ("x", 76.0), ("x", 9.5), ("y", 718.2), ("y", 85.5), ("y", 10.6875),
    ]  # fmt: skip
    assert {p.shifts_rad for p in fringes} == {equal_shifts(4)}
    assert not any(isinstance(p, GrayCode) for p in patterns("multi-frequency"))


@pytest.mark.parametrize(("size", "square"), [((608, 684), 20.0), ((1920, 1080), 36.0)])
def test_paper_calibrate(size: tuple[int, int], square: float) -> None:
    """The paper's fringes and code without its code frame, and thirty squares on the short side."""
    shown = patterns("paper-calibrate", width=size[0], height=size[1])
    others = [p for p in shown if p != Checkerboard(square)]
    whole = patterns("paper", width=size[0], height=size[1])
    assert others == [p for p in whole if not isinstance(p, Codeword)]
    assert shown[-3:] == [Checkerboard(square), Uniform(1.0), Uniform(0.0)]


class TestDoubleThreeStep:
    def test_it_is_two_sets_of_three_that_make_six_equal_steps(self) -> None:
        fringe = patterns("double-three-step")[0]
        assert isinstance(fringe, Fringe)
        degrees = [round(math.degrees(shift)) for shift in fringe.shifts_rad]
        assert degrees == [120, 0, -120, 180, 60, -60]
        assert fringe.shifts_rad[:3] == equal_shifts(3)
        assert sorted(shift % 360 for shift in degrees) == [0, 60, 120, 180, 240, 300]

    def test_other_steps_are_refused(self) -> None:
        message = "steps must be 6 of preset double-three-step, got 8"
        with pytest.raises(UsageError, match=message):
            patterns("double-three-step", steps=8)

    def test_six_steps_leave_less_ripple_than_two_averaged_phases(self) -> None:
        """Gamma 2.2, harmonics h of `light`: three leave h2 + h4, their mean its square, six h5."""
        phase = np.linspace(-np.pi, np.pi, 3601)
        shifts = np.array(paired_shifts())[:, None]
        light = (0.5 + 0.5 * np.cos(phase - shifts)) ** 2.2 * np.exp(1j * shifts)
        away = np.exp(-1j * phase)
        first, second = (np.angle(half.sum(axis=0) * away) for half in (light[:3], light[3:]))
        three, mean = np.std(first), np.std((first + second) / 2)
        six = np.std(np.angle(light.sum(axis=0) * away))
        assert three == pytest.approx(0.20, abs=0.01)  # h2 = 1.2 / 4.2, over sqrt 2
        assert mean < 1.2 * three**2
        assert six < 0.1 * mean


def test_explained_harmonics_are_rejected_and_the_next_are_not() -> None:
    """The sentence of each preset against sums of its own shifts."""
    for preset in PRESETS:
        fringe = next(p for p in patterns(preset) if isinstance(p, Fringe))
        steps = fringe.frame_count
        shifts = np.array(fringe.shifts_rad)
        let_in = {
            order
            for order in range(2, steps + 2)
            if max(abs(np.exp(1j * (1 + sign * order) * shifts).sum()) for sign in (1, -1)) > 1e-9
        }
        assert let_in == {steps - 1, steps + 1}
        sentence = explain_preset(preset)
        assert f"let {steps - 1} and {steps + 1} through" in sentence
        assert f"{math.sqrt(2 / steps):.2f} sigma_I / B" in sentence
    assert "reject harmonics 2 to 6" in explain_preset("measure")


def test_probe() -> None:
    """White, long fringes, fine ones along both axes, grey stripes under the long ones, black."""
    shown = [item.pattern for item in probe_sequence(width=608, height=684).sets]
    fine = [Fringe(axis, period, equal_shifts(4)) for axis in AXES for period in (16.0, 4.0)]
    stripes = Colour("x", 64.0, ("#404040", "#bfbfbf"))
    long = Fringe("x", 64.0, equal_shifts(8))
    assert shown == [Uniform(1.0), long, *fine, stripes, Uniform(0.0)]
    assert sum(pattern.frame_count for pattern in shown) == 27


@given(extent=st.integers(2, 8192))
def test_ladder(extent: int) -> None:
    ladder = frequency_ladder(extent)
    assert ladder[0] == pytest.approx(1.05 * extent)
    assert list(ladder) == sorted(set(ladder), reverse=True)
    assert min(ladder) >= min(6.0, ladder[0])
    if extent >= 384:
        assert ladder[1:] == (extent / 8, extent / 64)


class TestOptions:
    def test_one_axis_takes_the_code_frame_along(self) -> None:
        along_y = patterns("paper", axes=("y",))
        assert {getattr(p, "axis", "y") for p in along_y} == {"y"}
        assert Codeword("y", 32.0, (2.0, 3.0, 4.0, 5.0, 6.0, 8.0)) in along_y

    def test_periods_are_sorted_and_the_coarsest_is_coded(self) -> None:
        first = patterns("measure", periods_px=(200 / 3, 100.0), steps=4)[:3]
        assert first == [
            Fringe("x", 100.0, equal_shifts(4)),
            Fringe("x", 200 / 3, equal_shifts(4)),
            GrayCode("x", 3, 100.0, complementary=True),
        ]

    def test_any_two_colours_say_where_they_are(self) -> None:
        (frame,) = (
            p for p in patterns("paper", code="colour", axes=("x",)) if isinstance(p, Colour)
        )
        colours = frame.palette
        assert (frame.axis, frame.period_px, len(colours)) == ("x", 32.0, 20)  # orders 0 to 19
        assert len(set(itertools.pairwise(colours))) == 19
        assert set(colours) <= {"red", "green", "blue", "cyan", "magenta", "yellow"}

    def test_codes(self) -> None:
        assert GrayCode("x", 5, 32.0) in patterns("paper", code="gray")
        assert not any(isinstance(p, GrayCode) for p in patterns("paper", code="none"))
        assert Staircase("x", 32.0, 20, equal_shifts(3)) in patterns("paper", code="staircase")
        assert GrayCode("x", 6, 16.0, True, True) in patterns("measure", inverted=True)
        assert not any(isinstance(p, Codeword) for p in patterns("paper", codewords_px=()))
        assert Codeword("x", 16.0, (3.0, 5.0)) in patterns("measure", codewords_px=(3.0, 5.0))

    def test_one_fringe_needs_no_code(self) -> None:
        alone = patterns("measure", periods_px=(800.0,))
        assert not any(isinstance(p, GrayCode) for p in alone)
        wide = [p for p in patterns("measure", periods_px=(650.0,)) if isinstance(p, GrayCode)]
        assert [code.axis for code in wide] == ["y"]
        # 620 px is wider than the axis, but without the guard of 5 %.
        assert GrayCode("x", 1, 620.0, complementary=True) in patterns(
            "measure", periods_px=(620.0,)
        )

    def test_multi_frequency_with_a_code_needs_no_guard(self) -> None:
        coded = patterns("multi-frequency", periods_px=(64.0, 8.0), code="gray")
        assert GrayCode("x", 4, 64.0) in coded


REFUSED_OPTIONS: list[tuple[dict[str, Any], str]] = [
    ({"width": 1}, "width must be 2 to 8192 projector pixels, got 1"),
    ({"height": 100_000}, "height must be 2 to 8192 projector pixels, got 100000"),
    ({"axes": ()}, "axes must be x, y or both, each once, got ()"),
    ({"axes": ("x", "x")}, "axes must be x, y or both, each once, got ('x', 'x')"),
    ({"axes": ("z",)}, "axes must be x, y or both, each once, got ('z',)"),
    ({"steps": 2}, "steps must be 3 to 64, got 2"),
    ({"steps": 1000}, "steps must be 3 to 64, got 1000"),
    (
        {"code": "binary"},
        "code must be one of none, gray, complementary, staircase, colour, got binary",
    ),
    (
        {"periods_px": (1.5,)},
        "periods_px must be different periods of at least 2 px, one or more, got (1.5,)",
    ),
    ({"periods_px": ()}, "periods_px must be different periods of at least 2 px, one or more"),
    ({"periods_px": (math.nan,)}, "periods_px must be different periods of at least 2 px"),
    ({"periods_px": (16.0, 16.0)}, "periods_px must be different periods of at least 2 px"),
    (
        {"periods_px": (33.0,)},
        "cell_px must be a width whose edges (every 16.5 px from the image's edge) meet no pixel "
        "centre, as an even whole number is, got 33",
    ),
    ({"periods_px": (2.5,), "code": "gray"}, "as a whole number is, got 2.5"),
    (
        {"periods_px": (33.0,), "code": "gray", "codewords_px": (2.0,)},
        "period_px must be an even whole number of px under a code frame, got 33",
    ),
    (
        {"codewords_px": (2.0, 17.0)},
        "codewords_px must be different periods from 2 px to the fringe's 16 px, got (2.0, 17.0)",
    ),
    ({"codewords_px": (3.0, 3.0)}, "codewords_px must be different periods"),
]


@pytest.mark.parametrize(("options", "message"), REFUSED_OPTIONS)
def test_refused_options(options: dict[str, Any], message: str) -> None:
    with pytest.raises(UsageError, match=re.escape(message)) as error:
        patterns("measure", **options)
    assert error.value.exit_status == 2


def test_refused_preset() -> None:
    message = f"preset must be one of {', '.join(PRESETS)}, got fast"
    with pytest.raises(UsageError, match=f"^{message}$"):
        patterns("fast")  # type: ignore[arg-type]
    assert set(get_args(Preset)) == set(PRESETS)


def test_guard_of_the_coarsest_period() -> None:
    message = (
        "the coarsest of periods_px must be at least 718.2 px, 1.05 times the axis' 684 px, got 700"
    )
    with pytest.raises(UsageError, match=f"^{message}$"):
        patterns("multi-frequency", periods_px=(10.0, 700.0, 80.0))
    assert patterns("multi-frequency", periods_px=(700.0, 80.0, 10.0), axes=("x",))


STEPS = equal_shifts(3)
REFUSED_PATTERNS: list[tuple[Pattern, str]] = [
    (Fringe("x", 1.9, STEPS), "period_px must be at least 2 px, got 1.9"),
    (Fringe("x", math.inf, STEPS), "period_px must be at least 2 px, got inf"),
    (Fringe("x", 16.0, ()), "shifts must be three at least that differ clearly"),
    (Fringe("x", 16.0, equal_shifts(2)), "modulo 360 degrees, got 2: 0, 180"),
    (Fringe("x", 16.0, (0.0, 2.0, 2.0 - 2 * math.pi)), "differ clearly modulo 360 degrees, got 3"),
    (Fringe("x", 16.0, (0.0, 2.0, math.nan)), "differ clearly modulo 360 degrees, got 3"),
    (Staircase("x", 32.0, 20, equal_shifts(2)), "shifts must be three at least"),
    (GrayCode("x", 5, 16.0), "bits must be 6 to 16 for 608 px in cells of 16 px, got 5"),
    (GrayCode("x", 17, 16.0), "bits must be 6 to 16"),
    (GrayCode("x", 16, 0.5), "cell_px must be at least 1 px, got 0.5"),
    (GrayCode("x", 16, 1.0, complementary=True), "cell_px must be at least 2 px, got 1"),
    (GrayCode("y", 10, 1.5), "cell_px must be a width whose edges (every 1.5 px"),
    (Codeword("x", 32.0, ()), "codewords_px must be different periods from 2 px to"),
    (Codeword("x", 32.0, (2.0,), zero_px=0.0), "zero_px must be on an edge between pixels, got 0"),
    (
        Codeword("x", 32.0, (2.0, 3.0), sequence=(0, 1) * 9),
        "sequence must be long enough for orders 0 to 19, got 18 entries",
    ),
    (
        Codeword("x", 32.0, (2.0, 3.0), sequence=(0, 1) * 10, zero_px=15.5),
        "sequence must be long enough for orders -1 to 19",
    ),
    (Codeword("x", 32.0, (2.0, 3.0), sequence=(0, 2)), "sequence must be of indices 0 to 1"),
    (
        Staircase("x", 32.0, 19, STEPS),
        "levels must be at least 20, one per fringe order 0 to 19, got 19",
    ),
    (Staircase("x", 33.0, 19, STEPS), "period_px must be a width whose edges (every 16.5 px"),
    (Colour("x", 33.0, ("red",)), "period_px must be a width whose edges"),
    (Colour("x", 32.0, ()), "palette must be one colour at least, got none"),
    (Colour("x", 32.0, ("mauve",)), "white or #rrggbb, got 'mauve'"),
    (Colour("x", 32.0, ("#ff00",)), "or #rrggbb, got '#ff00'"),
    (Uniform(1.5), "level must be 0 to 1 of full scale, got 1.5"),
    (Uniform(math.nan), "level must be 0 to 1 of full scale, got nan"),
    (Checkerboard(16.5), "square_px must be a width whose edges (every 16.5 px"),
    (Checkerboard(0.0), "square_px must be at least 1 px, got 0"),
    (Speckle(1, 0.5), "dot_px must be 1 px to the shorter side of the image, got 0.5"),
]


@pytest.mark.parametrize(("pattern", "message"), REFUSED_PATTERNS)
def test_refused_patterns(pattern: Pattern, message: str) -> None:
    with pytest.raises(UsageError, match=re.escape(message)):
        check_pattern(pattern, width=608, height=684)


class TestCodeFrameNeedsItsFringes:
    code = Codeword("x", 32.0, (2.0, 3.0))

    @pytest.mark.parametrize(
        "other",
        [
            Fringe("y", 32.0, STEPS),
            Fringe("x", 16.0, STEPS),
            Fringe("x", 32.0, STEPS, zero_px=0.5),
            Uniform(1.0),
        ],
    )
    def test_other_fringes(self, other: Pattern) -> None:
        sequence = Sequence(608, 684, (PatternSet(other), PatternSet(self.code)))
        message = "a code frame must be beside fringes of its own axis, period and zero, got none"
        with pytest.raises(UsageError, match=message):
            check_sequence(sequence)

    def test_in_every_group(self) -> None:
        fringe = Fringe("x", 32.0, STEPS)
        both = (PatternSet(fringe, group="a"), PatternSet(fringe, group="b"), PatternSet(self.code))
        check_sequence(Sequence(608, 684, both))
        one = (both[0], PatternSet(Uniform(1.0), group="b"), both[2])
        with pytest.raises(UsageError, match="a code frame must be"):
            check_sequence(Sequence(608, 684, one))


@pytest.mark.parametrize(
    ("extent", "cell", "meets"),
    [
        (608, 16.5, True),
        (608, 16.0, False),
        (608, 33.0, False),
        (608, 1.0, False),
        (608, 0.5, True),
        (1920, 200 / 3, False),
        (16, 16.5, False),  # the edge at 16 is the image's own far side
        (17, 16.5, True),
        (100, 32.25, True),  # the second edge, 64.5 px from the image's
    ],
)
def test_edges_on_pixel_centres_are_found(extent: int, cell: float, meets: bool) -> None:
    assert (pixel_on_edge(extent, cell) is not None) is meets


@pytest.mark.parametrize("preset", get_args(Preset))
def test_the_guides_table(preset: Preset) -> None:
    """docs/patterns.md counts frames as the presets do."""
    cells = next(
        line.split("|") for line in GUIDE.read_text("utf-8").splitlines()
        if line.startswith(f"| `{preset}` |")
    )  # fmt: skip
    counts = [
        sum(item.image_count for item in make_sequence(preset, width=w, height=h).sets)
        for w, h in ((608, 684), (1920, 1080))
    ]
    assert [int(cell) for cell in cells[-3:-1]] == counts
