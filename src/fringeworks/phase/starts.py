"""Which orders the regions have, from what their patches say of every codeword.

Regions are of one surface each as far as the phase can tell. Two surfaces that touch where their
phases happen to agree make one region of two starts; there its patches disagree, and it is split.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.codeframe import sum_around
from fringeworks.model import FloatMap
from fringeworks.model.phase import OrderMap
from fringeworks.phase.groups import (
    LEAST_NATS,
    NEVER,
    Groups,
    Judged,
    Orders,
    Said,
    group_patches,
    hear,
    judge,
)
from fringeworks.phase.patches import LEAST_PIXELS, Patches

SPLIT_NATS = 10.0
"""Cost of an order that is not the region's."""

CONTRADICTION_NATS = 12.0
"""A patch whose own codeword says more than that against its order sees more than one surface."""

ROWS_AROUND = 3
"""Rows of tiles that vote together: their pixels share the model's error."""

Array = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Starts:
    """What was found.

    Attributes
    ----------
    shift
        ``(patches,)``: what to add to the turns.
    nats
        ``(patches,)``: by which it is ahead of all others; NaN where that is not enough.
    transfer, scale
        ``(patches,)``: index of the transfer that holds there, and by how much the likelihood of
        pixels in a few rows is too sure.
    gain
        Log-likelihood by which the code explains the frame better than no code does, nats.
    misfit
        Share of what the frame shows beyond noise that the code leaves unexplained.
    """

    shift: OrderMap
    nats: FloatMap
    transfer: OrderMap
    scale: FloatMap
    gain: float
    misfit: float


def find_starts(
    patches: Patches, fit: Array, flat: Array, orders: Orders, *, samples: float
) -> Starts:
    """The likeliest start of every region, and of parts of it that contradict theirs.

    Parameters
    ----------
    patches
        One at least.
    fit, flat
        As `fit_words` gives them.
    samples
        Independent samples of the model's error along a fringe.
    """
    outside = fit.shape[2]
    regions = group_patches(patches, patches.region, orders, outside=outside)
    said = hear(patches, fit, flat, regions, samples)
    scale = said.too_sure(ROWS_AROUND * patches.pixels / samples)
    groups, judged = regions, judge(patches, said, regions)
    elsewhere = judged.elsewhere[regions.owner]
    shift = judged.start[regions.owner] - regions.base
    wanted = _vote(patches, said, regions, judged, scale) - regions.base
    if (wanted != shift).any():
        _, parts = np.unique(np.stack([patches.region, wanted]), axis=1, return_inverse=True)
        groups = group_patches(patches, parts.ravel(), orders, outside=outside)
        judged = judge(patches, said, groups)
    found = _report(patches, said, groups, judged, scale, shown=float(flat.sum()))
    split = found.shift != shift
    found.nats[split] -= np.float32(SPLIT_NATS)
    found.nats[elsewhere] = np.nan  # of its parts each would find something inside the window
    found.nats[found.nats < LEAST_NATS] = np.nan
    found.shift[:] += np.int32(orders.first)
    return found


def _vote(
    patches: Patches, said: Said, regions: Groups, judged: Judged, scale: Array
) -> NDArray[np.intp]:
    """Start of each patch: its region's, unless it and those that it goes on in outvote that.

    Two surfaces that touch where their phases happen to agree make one region of two starts.
    """
    own = said.of_starts(regions, said.transfer, scale)
    rows, of_region = np.arange(len(own)), judged.start[regions.owner]
    forbidden = ~regions.allowed
    forbidden[rows, of_region] = False
    own[forbidden] = NEVER
    number = np.full(patches.slots, -1, np.int32)
    number[patches.place] = rows
    around = np.zeros_like(own)
    sum_around(patches.place, number, patches.link, own, around)
    around[rows, of_region] += np.float32(SPLIT_NATS)
    return np.asarray(around.argmax(axis=1))


def _report(
    patches: Patches, said: Said, groups: Groups, judged: Judged, scale: Array, *, shown: float
) -> Starts:
    """What was judged, per patch; `shown` is the misfit of no code at all."""
    rows, start = np.arange(len(scale)), judged.start[groups.owner]
    transfer = judged.transfer[groups.owner]
    own = said.of_starts(groups, transfer, scale)
    few = groups.total(patches.pixels)[groups.owner] < LEAST_PIXELS
    contradicted = own.max(axis=1) - own[rows, start] > CONTRADICTION_NATS
    explained = 2 * float(said.fit[rows, transfer, groups.word[rows, start]].sum())
    beyond = shown - float((patches.pixels * said.noise).sum())
    nothing = np.float32(np.nan)
    return Starts(
        shift=(start - groups.base).astype(np.int32),
        nats=np.where(few | contradicted, nothing, judged.nats[groups.owner]).astype(np.float32),
        transfer=transfer.astype(np.int32),
        scale=scale.astype(np.float32),
        gain=float(own[rows, start].sum()),
        misfit=(beyond - explained) / max(beyond, 1.0),
    )
