"""Which order a residual field has, and whether there is one: what unseen poses say.

Views are left out one at a time. A polynomial that is fitted to the others is held against the one
left out, over regions of the board that are large enough for noise to vanish in them. Of all
orders the lowest is taken that is within one standard error of the best, and it is used only where
unseen views gain by it beyond doubt.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.judge.structure import CELLS_IN_VIEW, LEAST_IN_CELL, lay_cells
from fringeworks.calibrate.residual.fit import Domain, fit_polynomial, fits_without
from fringeworks.calibrate.residual.left import Left, find_left
from fringeworks.errors import CalibrationError
from fringeworks.model import AXES, Axis, Camera, ModelName, ResidualField, Rig

Array = NDArray[np.float64]

ORDERS = (1, 2, 3, 4)
"""The fifth had wild corners on every rig, and was never the best."""

CERTAIN = 2.0
"""Standard errors by which unseen views must gain."""

LEAST_GAIN = 0.1
"""Share of their mean square that they must gain: below it a rig is only harder to read."""

LEAST_VIEWS = 5


@dataclass(frozen=True, slots=True)
class Choice:
    """What came of fitting a model's residual field along an axis.

    Attributes
    ----------
    gains
        By order of `ORDERS`: share of the mean square of views not seen that it takes away, and
        its standard error.
    rms_px
        Root mean square of those without it, and with the order that was best: of medians over
        sixteenths of the board.
    field
        None where unseen views do not gain.
    """

    model: ModelName
    axis: Axis
    gains: tuple[tuple[float, float], ...]
    rms_px: tuple[float, float]
    field: ResidualField | None

    @property
    def words(self) -> str:
        """One sentence."""
        before, after = self.rms_px
        told = (
            f"{self.model} model along {self.axis}: regions of views that the fit has not seen "
            f"are off by {before:.4f} px rms"
        )
        if self.field is None:
            gain, sigma = max(self.gains)
            return f"{told}, and gain {gain:.0%} (1 sd {sigma:.0%}) at best: no residual field"
        return f"{told}, with a residual field of order {self.field.order} by {after:.4f} px"


def choose_fields(
    rig: Rig, models: Sequence[ModelName] = ("full", "geometric", "extended")
) -> tuple[Choice, ...]:
    """Choose the field of each model and axis that the rig's calibration wants.

    The extended model has the one axis of its parameters, and is passed over where the rig has
    none.

    Raises
    ------
    CalibrationError
        As `find_left`, or fewer than five views.
    """
    return tuple(
        choose_field(find_left(rig, model, axis), rig.camera, belongs=(model, axis))
        for model in models
        for axis in _axes(rig, model)
    )


def choose_field(left: Left, camera: Camera, *, belongs: tuple[ModelName, Axis]) -> Choice:
    """Choose an order by leaving one view out after the other, and fit it to all.

    Raises
    ------
    CalibrationError
        Fewer than five views.
    """
    views = np.unique(left.view)
    if len(views) < LEAST_VIEWS:
        raise CalibrationError(
            f"a residual field needs at least {LEAST_VIEWS} views with sites all over the board, "
            f"got {len(views)}"
        )
    domain = Domain.of(left, camera)
    plain = np.array([_mean_square(left.only(left.view == view)) for view in views])
    errors = np.array([_errors(left, order, domain) for order in ORDERS])
    gains = [_gain(plain, part) for part in errors]
    place = _simplest(errors)
    gain, sigma = gains[place]
    field = None
    if gain > max(LEAST_GAIN, CERTAIN * sigma):
        order = ORDERS[place]
        terms = fit_polynomial(left, domain.design(left.places, order)).coefficients
        field = ResidualField(
            *belongs,
            order,
            domain.middle,
            domain.low,
            domain.high,
            coefficients=tuple(terms.tolist()),
            gain=gain,
            gain_sigma=sigma,
        )
    before, after = np.sqrt([plain.mean(), errors[place].mean()]).tolist()
    return Choice(*belongs, tuple(gains), (before, after), field)


def _axes(rig: Rig, model: ModelName) -> tuple[Axis, ...]:
    if model != "extended":
        return AXES
    return () if rig.extended is None else (rig.extended.axis,)


def _errors(left: Left, order: int, domain: Domain) -> Array:
    """``(views,)`` mean square of each view less a polynomial of the others, px^2."""
    design = domain.design(left.places, order)
    without = fits_without(left, design, fit_polynomial(left, design))
    out = []
    for view, coefficients in zip(np.unique(left.view), without, strict=True):
        own = left.view == view
        out.append(_mean_square(left.only(own), design[own] @ coefficients))
    return np.array(out)


def _mean_square(left: Left, told: Array | float = 0.0) -> float:
    """Of medians over sixteenths of a view: neither noise nor wrong codes say much there."""
    off, cell = left.residual - told, lay_cells(left.places[:, :2], CELLS_IN_VIEW)
    full = np.flatnonzero(np.bincount(cell) >= LEAST_IN_CELL)
    return float(np.mean([np.median(off[cell == place]) ** 2 for place in full]))


def _gain(plain: Array, errors: Array) -> tuple[float, float]:
    """Share of the views' mean squares that is gone, and its standard error as of a ratio."""
    gain = 1 - errors.sum() / plain.sum()
    rest = errors - (1 - gain) * plain
    return float(gain), _sigma_of_mean(rest) / float(plain.mean())


def _simplest(errors: Array) -> int:
    """Of orders' errors ``(orders, views)``, the first within one standard error of the best."""
    worse = errors - errors[np.argmin(errors.mean(axis=1))]
    return next(place for place, part in enumerate(worse) if part.mean() <= _sigma_of_mean(part))


def _sigma_of_mean(values: Array) -> float:
    return float(values.std(ddof=1) / np.sqrt(len(values)))
