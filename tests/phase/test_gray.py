"""Gray codes, alone and under fringes, at every sub-pixel offset of the projector."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.errors import FormatError
from fringeworks.model import (
    CodedAxis,
    Frames,
    Fringe,
    GrayCode,
    Pattern,
    PatternSet,
    Sensor,
    Uniform,
    Void,
    gray_bits,
)
from fringeworks.phase.decode import decode_capture, decode_phases
from tests.phase.encoding import (
    BLACK,
    SENSOR_16,
    WHITE,
    Scene,
    capture_of,
    equal_shifts,
    repeated,
    sweep,
)

WIDTH = 640
PERIOD = 32.0
FRINGE = Fringe("x", PERIOD, equal_shifts(4))

# Sixteen bits: rounding moves the phase by 0.5 / 25000 * sqrt 2 at most, 1e-4 px of this period.
PLANE = Scene(
    sweep(WIDTH, samples_per_px=32), WIDTH, offset=30000.0, modulation=25000.0, sensor=SENSOR_16
)
ROUNDING_PX = 3e-4


def code_of(cell_px: float, *, inverted: bool = False, complementary: bool = False) -> GrayCode:
    bits = gray_bits(WIDTH, cell_px)
    return GrayCode("x", bits, cell_px, inverted=inverted, complementary=complementary)


PLAIN, COMPLEMENTARY = code_of(PERIOD), code_of(PERIOD, complementary=True)


def decoded(scene: Scene, *patterns: Pattern) -> CodedAxis:
    column = decode_capture(scene.capture(*patterns)).column
    assert column is not None
    return column


def least_margin(axis: CodedAxis) -> float:
    assert axis.phase is not None
    return float(np.nanmin(axis.phase.margin))


class TestAlone:
    @pytest.mark.parametrize("cell", [1.0, 2.0, 7.0, 32.0, 100.0, 200 / 3, 640.0])
    def test_centre_of_the_cell(self, cell: float) -> None:
        axis = decoded(PLANE, code_of(cell), WHITE, BLACK)
        assert axis.phase is None
        assert np.isfinite(axis.coordinate).all()
        truth = (np.floor((PLANE.u + 0.5) / cell) + 0.5) * cell - 0.5
        np.testing.assert_allclose(axis.coordinate, truth, atol=1e-4)
        # Anywhere in the cell with the same right: cell / sqrt 12, here as sampled. The last cell
        # of a projector that it does not divide is cut short.
        np.testing.assert_allclose(axis.sigma, cell / np.sqrt(12), rtol=1e-6)
        if WIDTH % cell == 0:
            observed = np.std(axis.coordinate - PLANE.u)
            np.testing.assert_allclose(observed, cell / np.sqrt(12), rtol=2e-3)

    def test_complement_halves_the_cell(self) -> None:
        axis = decoded(PLANE, COMPLEMENTARY, WHITE, BLACK)
        truth = (np.floor((PLANE.u + 0.5) / 16) + 0.5) * 16 - 0.5
        np.testing.assert_allclose(axis.coordinate, truth, atol=1e-4)

    def test_along_y(self) -> None:
        scene = dataclasses.replace(PLANE, u=PLANE.u.reshape(32, -1))
        code = dataclasses.replace(PLAIN, axis="y")
        coded = decode_capture(scene.capture(code, WHITE, BLACK))
        assert coded.column is None
        assert coded.row is not None
        truth = (np.floor((scene.u + 0.5) / 32) + 0.5) * 32 - 0.5
        np.testing.assert_allclose(coded.row.coordinate, truth, atol=1e-4)

    def test_codes_outside_the_image_are_void(self) -> None:
        # 5 bits of 32 px reach to 1024: codes of cells from 640 on mean nothing.
        beyond = dataclasses.replace(PLANE, u=np.array([[5.0, 639.4, 639.6, 700.0, 1000.0]]))
        axis = decoded(beyond, PLAIN, WHITE, BLACK)
        assert axis.void.tolist() == [[0, 0, Void.ORDER, Void.ORDER, Void.ORDER]]
        assert np.isnan(axis.coordinate).tolist() == [[False, False, True, True, True]]

    def test_repeats_are_averaged(self) -> None:
        # Each frame three times, one of each blown dark: the mean of two lit ones is still lit.
        scene = dataclasses.replace(PLANE, offset=120.0, modulation=100.0, sensor=Sensor(255.0))
        frames = repeated(scene.frames(PLAIN), 3)
        frames[1::3] = 20
        sets: list[tuple[Pattern | PatternSet, Frames]] = [
            (PatternSet(PLAIN, repeats=3), frames),
            (WHITE, scene.frames(WHITE)),
            (BLACK, scene.frames(BLACK)),
        ]
        column = decode_capture(capture_of(*sets, extent=WIDTH)).column
        assert column is not None
        truth = (np.floor((PLANE.u + 0.5) / 32) + 0.5) * 32 - 0.5
        np.testing.assert_allclose(column.coordinate, truth, atol=1e-4)

    def test_finest_of_two(self) -> None:
        axis = decoded(PLANE, code_of(64.0), code_of(4.0), code_of(16.0), WHITE, BLACK)
        assert axis.route == ("Gray code of 4 px cells",)


class TestUnderFringes:
    @pytest.mark.parametrize("blur_px", [0.0, 1.0, 4.0])
    @pytest.mark.parametrize(
        "code",
        [PLAIN, COMPLEMENTARY, code_of(PERIOD / 2), code_of(PERIOD, inverted=True)],
        ids=["plain", "complementary", "half cells", "inverted"],
    )
    def test_every_offset(self, code: GrayCode, blur_px: float) -> None:
        """Ideal thresholds: half light is at the edge, whatever the blur."""
        scene = dataclasses.replace(PLANE, blur_px=blur_px)
        axis = decoded(scene, FRINGE, code, WHITE, BLACK)
        assert np.isfinite(axis.coordinate).all()
        assert np.abs(axis.coordinate - scene.u).max() <= ROUNDING_PX
        assert axis.phase is not None
        order = np.ceil((scene.u + 0.5) / PERIOD - 0.5)  # (2 pi k - pi, 2 pi k + pi]
        clear = np.abs((scene.u + 0.5) / PERIOD % 1 - 0.5) > 1e-4  # phi is not +-pi to rounding
        np.testing.assert_array_equal(axis.phase.order[clear], order[clear])
        assert axis.phase.order.min() == 0
        assert axis.phase.order.max() == 20  # the second half fringe of 640 / 32 periods

    def test_plain_has_no_margin_and_the_complement_has_half(self) -> None:
        assert least_margin(decoded(PLANE, FRINGE, PLAIN, WHITE, BLACK)) < 0.001
        # One sample in 32 of a pixel, 1/32 / 16, and the coordinate's rounding.
        halves = least_margin(decoded(PLANE, FRINGE, COMPLEMENTARY, WHITE, BLACK))
        assert halves == pytest.approx(0.5, abs=2e-3)
        halves = least_margin(decoded(PLANE, FRINGE, code_of(PERIOD / 2), WHITE, BLACK))
        assert halves == pytest.approx(0.5, abs=2e-3)

    def test_complement_repairs_a_bad_threshold(self) -> None:
        """Blur of 4 px and a threshold a tenth too high move each edge by 0.2 px."""
        scene = dataclasses.replace(PLANE, blur_px=4.0)
        dark = Uniform(0.1)  # a "black" frame with light in it: the mean rises by a twentieth
        plain = decoded(scene, FRINGE, PLAIN, WHITE, dark)
        wrong = np.abs(plain.coordinate - scene.u) > PERIOD / 2
        # 19 inner edges; 4 px * 0.05 = 0.2 px of each go wrong, 6.4 samples of 32 per px.
        assert np.count_nonzero(wrong) == pytest.approx(19 * 6.4, abs=19)
        near_edge = (scene.u[wrong] + 0.5) % PERIOD
        assert np.minimum(near_edge, PERIOD - near_edge).max() < 0.25
        for repaired in (COMPLEMENTARY, code_of(PERIOD / 2)):
            axis = decoded(scene, FRINGE, repaired, WHITE, dark)
            assert np.abs(axis.coordinate - scene.u).max() <= ROUNDING_PX

    def test_half_fringes_of_both_edges(self) -> None:
        axis = decoded(PLANE, FRINGE, COMPLEMENTARY, WHITE, BLACK)
        assert axis.phase is not None
        first, last = PLANE.u < 15.4, PLANE.u > 623.6
        assert set(axis.phase.order[first]) == {0}
        assert set(axis.phase.order[last]) == {20}
        assert np.isfinite(axis.coordinate[first | last]).all()

    @pytest.mark.parametrize("zero", [-0.5, 0.0, 15.5, 100.25, -1000.0])
    def test_any_zero(self, zero: float) -> None:
        fringe = dataclasses.replace(FRINGE, zero_px=zero)
        axis = decoded(PLANE, fringe, COMPLEMENTARY, WHITE, BLACK)
        assert np.abs(axis.coordinate - PLANE.u).max() <= ROUNDING_PX
        assert axis.phase is not None
        # Absolute phase counts from zero_px, also to its left, where orders are negative.
        truth = 2 * np.pi * (PLANE.u - zero) / PERIOD
        # rounding of the frames, and single precision of up to 322 rad
        assert np.abs(axis.phase.phase - truth).max() <= 6e-5 + 3e-5

    def test_two_doubtful_bits_are_void(self) -> None:
        # Grey levels 100 +- 80; one pixel whose first two bits are at the threshold, one whose
        # last alone is: that one lies on an edge and is good.
        scene = Scene(np.array([[100.0, 111.5, 300.0]]), WIDTH, offset=100.0, modulation=80.0,
                      sensor=Sensor(255.0, gain=0.0, read_noise=1.0))  # fmt: skip
        bits = scene.frames(PLAIN)
        bits[:2, 0, 2] = 99, 101  # as they should be (cell 9 is 01101), but only just
        bits[4, 0, 1] = 100
        sets = [(PLAIN, bits), *((p, scene.frames(p)) for p in (FRINGE, WHITE, BLACK))]
        (axis,) = decode_phases(capture_of(*sets, extent=WIDTH, sensor=scene.sensor)).coded
        assert axis.void.tolist() == [[0, 0, Void.ORDER]]


class TestThreshold:
    """Inverse frames first, then white and black, then the fringes' offset."""

    U = sweep(WIDTH, samples_per_px=2)
    CELLS = (np.floor((U + 0.5) / 32) + 0.5) * 32 - 0.5

    def read(self, *sets: tuple[Pattern, Frames]) -> NDArray[np.float32]:
        (axis, *_) = decode_phases(capture_of(*sets, extent=WIDTH)).coded
        assert axis.axis == "x"
        return axis.coordinate

    def scene(self, dark: float, light: float) -> Scene:
        return Scene(self.U, WIDTH, offset=(light + dark) / 2, modulation=(light - dark) / 2)

    def test_inverse_before_white_and_black(self) -> None:
        code = code_of(32.0, inverted=True)
        bits = self.scene(20, 100).frames(code)
        misleading = self.scene(130, 230)  # its mean, 180, is above all bits
        coordinate = self.read(
            (code, bits), (WHITE, misleading.frames(WHITE)), (BLACK, misleading.frames(BLACK))
        )
        np.testing.assert_array_equal(coordinate, self.CELLS)

    def test_inverse_alone(self) -> None:
        code = code_of(32.0, inverted=True)
        np.testing.assert_array_equal(
            self.read((code, self.scene(20, 100).frames(code))), self.CELLS
        )

    def test_white_and_black_before_fringes(self) -> None:
        scene, misleading = self.scene(20, 100), self.scene(130, 230)
        coordinate = self.read(
            (PLAIN, scene.frames(PLAIN)),
            (FRINGE, misleading.frames(FRINGE)),
            (WHITE, scene.frames(WHITE)),
            (BLACK, scene.frames(BLACK)),
        )
        # The fringes make it fine; with their offset all bits would have been dark.
        assert np.abs(coordinate - self.U).max() < 0.5

    def test_fringes_of_the_axis(self) -> None:
        scene = self.scene(20, 100)
        coordinate = self.read((PLAIN, scene.frames(PLAIN)), (FRINGE, scene.frames(FRINGE)))
        assert np.abs(coordinate - self.U).max() < 0.5

    def test_fringes_of_the_other_axis(self) -> None:
        scene = self.scene(20, 100)
        along_y = dataclasses.replace(FRINGE, axis="y")
        coordinate = self.read((PLAIN, scene.frames(PLAIN)), (along_y, scene.frames(along_y)))
        np.testing.assert_array_equal(coordinate, self.CELLS)

    def test_nothing(self) -> None:
        scene = self.scene(20, 100)
        for lone in ((), (WHITE,), (BLACK,), (Uniform(0.5), WHITE)):
            with pytest.raises(FormatError, match="along x has nothing to tell light from dark"):
                self.read(*((p, scene.frames(p)) for p in (PLAIN, *lone)))
