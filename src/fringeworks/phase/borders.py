"""Pixels of patches in which two surfaces meet, decided one by one.

A depth jump hides from spatial unwrapping wherever it is a whole number of fringes. Where that is
so along a stretch of the border, both surfaces are one region, and patches across it hold both.
"""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.borders import mixed_slots, settle_mixed
from fringeworks.model import AbsolutePhase, Codeword, FloatMap, Frames, UnwrappedPhase
from fringeworks.phase.groups import LEAST_NATS, Orders
from fringeworks.phase.patches import Patches, code_noise, edge_bins
from fringeworks.phase.starts import Starts

Scalar = TypeVar("Scalar", bound=np.generic)


def settle_borders(
    phase: AbsolutePhase,
    image: Frames | FloatMap,
    code: Codeword,
    unwrapped: UnwrappedPhase,
    patches: Patches,
    starts: Starts,
    orders: Orders,
    templates: NDArray[np.float64],
    *,
    saturation: float,
) -> None:
    """Decide the pixels of mixed patches again, in place.

    A patch is mixed where its region has another start nearby, or where its own codeword
    contradicts its start.
    """
    wrapped, count = phase.wrapped, len(code.codewords_px)

    def per_slot(values: NDArray[Scalar], nothing: float) -> NDArray[Scalar]:
        spread = np.full(patches.slots, nothing, values.dtype)
        spread[patches.place] = values
        return spread

    weight = np.maximum(patches.weight.sum(axis=1), np.finfo(np.float32).tiny)
    known = ~np.isnan(starts.nats)
    owner, shift = per_slot(patches.region, -1), per_slot(starts.shift, 0)
    sure, mixed = per_slot(known, False), np.zeros(patches.slots, np.bool_)
    mixed_slots(owner, shift, sure, patches.tiles, mixed)
    settle_mixed(
        mixed,
        owner,
        shift,
        sure,
        per_slot(patches.code.sum(axis=1) / weight, 0),
        per_slot(starts.scale, 1),
        per_slot(starts.transfer, 0),
        image,
        (
            patches.at,
            wrapped.offset,
            wrapped.modulation,
            unwrapped.region,
            unwrapped.turns,
            patches.index,
        ),
        code_noise(wrapped),
        (saturation, edge_bins(code, templates.shape[2]), LEAST_NATS),
        (np.pad(orders.words, 1, constant_values=count), orders.first),
        templates.astype(np.float32),
        phase.order,
        phase.margin,
    )
