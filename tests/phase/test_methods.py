"""Names, and what `auto` and the names choose for a capture."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest

from fringeworks.cli.arguments import Orders
from fringeworks.errors import DecodeError, UsageError
from fringeworks.model import Capture, Codeword, Fringe, GrayCode, Pattern
from fringeworks.phase.decode import decode_phases
from fringeworks.phase.demodulate import demodulate
from fringeworks.phase.methods import METHODS, MethodName, OrdersName, choose_method
from fringeworks.phase.orders import AxisFrames
from tests.phase.codes import PAPER, Shown
from tests.phase.encoding import BLACK, WHITE, Scene, capture_of, equal_shifts, sweep

WIDTH = 256
SCENE = Scene(sweep(WIDTH, samples_per_px=1, rows=40), WIDTH)
FINE, COARSE = Fringe("x", 32.0, equal_shifts(3)), Fringe("x", 300.0, equal_shifts(3))
NARROW = Fringe("x", 16.0, equal_shifts(3))
GRAY = GrayCode("x", 4, 16.0)
WORDS = Codeword("x", 32.0, PAPER)


def capture(*patterns: Pattern) -> Capture:
    dark = np.zeros((1, *SCENE.u.shape), np.uint8)
    shown = [(p, dark if isinstance(p, Codeword) else SCENE.frames(p)) for p in patterns]
    return capture_of(*shown, extent=WIDTH)


def frames(*patterns: Pattern) -> AxisFrames:
    made = capture(*patterns)
    phases = [demodulate(f, p, made.sensor) for p, f, _ in made.find(Fringe)]
    return AxisFrames(made, "x", tuple(phases))


def test_the_command_line_knows_every_method() -> None:
    assert get_args(Orders) == ("auto", *METHODS)
    assert get_args(MethodName) == tuple(METHODS)


@pytest.mark.parametrize(
    ("patterns", "expected"),
    [
        ((FINE, GRAY, WORDS, WHITE, BLACK), "gray"),
        ((FINE, COARSE, WORDS), "frequencies"),
        ((FINE, WORDS), "code-frame"),
        ((FINE,), "frequencies"),  # which says what is missing
    ],
)
def test_auto(patterns: tuple[Pattern, ...], expected: str) -> None:
    assert choose_method("auto", frames(*patterns)) == expected


def test_what_is_asked_for_and_not_there() -> None:
    with pytest.raises(DecodeError, match=r"no staircase .* along x, which"):
        choose_method("staircase", frames(FINE, GRAY))
    for orders in ("staircase", "frequencies"):
        with pytest.raises(DecodeError):
            decode_phases(capture(FINE, WHITE, BLACK), orders=orders)


def test_advice_where_nothing_is_certain() -> None:
    with pytest.raises(DecodeError, match=r"not which they are: .* depth range"):
        decode_phases(capture(NARROW), orders="objects").projector_map()
    # Without light it is the exposure, whatever the method.
    black = [(p, np.zeros_like(f)) for p, f in [(FINE, SCENE.frames(FINE))]]
    with pytest.raises(DecodeError, match="Look at the frames' exposure"):
        decode_phases(capture_of(*black, extent=WIDTH), orders="objects").projector_map()


def test_no_such_method() -> None:
    wrong: OrdersName = "grey"  # type: ignore[assignment]
    with pytest.raises(UsageError, match=r"orders must be one of auto, gray, .*, got 'grey'"):
        decode_phases(capture(FINE), orders=wrong)


def test_a_faulty_code_frame_is_no_relative_axis() -> None:
    shown = Shown(100 + 0.8 * np.mgrid[:100, :200][1], WORDS)
    with pytest.raises(DecodeError, match="--z-range MIN:MAX"):
        decode_phases(shown.capture())


def test_frequencies_despite_a_gray_code() -> None:
    both = capture(FINE, COARSE, GRAY, WHITE, BLACK)
    (by_gray,), (by_fringes,) = (
        decode_phases(both, orders=orders).coded for orders in ("gray", "frequencies")
    )
    assert by_gray.route[0] == "Gray code of 16 px cells"
    assert by_fringes.route[0] == "fringes of 300 px"
    np.testing.assert_array_equal(by_gray.coordinate, by_fringes.coordinate)
