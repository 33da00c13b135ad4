"""Patches that share a start, and how likely each start is.

Inside a surface the order rises by one per turn, so that one number is asked of each: the order of
its first turn. Every start that the projector's image and the window admit is scored by the
likelihood of all its patches together, whatever the order of the codewords. How far the code is
blurred is not known beforehand and changes over the depth; it is found along the way, surface by
surface, and they agree on it unless the evidence says otherwise.

A likelihood of a model that is only nearly right is far too sure. The noise is taken from the
scatter within the patches' bins, which has the phase's own noise in it. What the best words leave
beyond that is an error of the model that all rows of a fringe have in common.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.codeframe import score_starts
from fringeworks.model.phase import OrderMap
from fringeworks.phase.patches import Patches

LEAST_NATS = math.log(100)
"""What the best start must be ahead of all others together."""

BLUR_NATS = 3.0
"""Cost of a region's blur that is n steps away from that of the whole image, times n^2."""

WINDOW_SHARE = 0.9
"""Share of a region's pixels that a start must put into the window."""

OUTSIDE_WINDOW_NATS = 12.0
"""What a start outside the window must be ahead of those inside for nothing to be certain: the
code repeats, so that both may fit, but where none inside fits the object is not where it is said
to be."""

NEARLY_TURNS = 0.1
"""By so much a patch's mean may miss the window."""

FEW_PIXELS = 100
"""As many pixels of the camera's own noise are added to what a region shows of it."""

MOST_NATS = np.float32(80)
"""Beyond that a lead is not counted."""

NEVER = np.float32(-1e9)

Array = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Orders:
    """Index of the word that each fringe order carries, ``(orders,)`` from order `first` on."""

    words: OrderMap
    first: int


@dataclass(frozen=True, slots=True)
class Groups:
    """Patches that share a start: those of a region, or of a part of one.

    Start k gives a group's own turn, that of its heaviest patch, the projector's k-th order.

    Attributes
    ----------
    owner, base
        ``(patches,)``: group, and that group's own turn.
    count
        How many groups there are.
    word
        ``(patches, starts)``: word that the patch would carry; the one after the last is "outside
        the projector's image".
    allowed
        ``(patches, starts)``: what the window admits.
    """

    owner: NDArray[np.intp]
    base: OrderMap
    count: int
    word: OrderMap
    allowed: NDArray[np.bool_]

    def total(self, values: Array) -> Array:
        """Sums over the groups."""
        return np.bincount(self.owner, values, self.count).astype(np.float32)


def group_patches(
    patches: Patches, names: NDArray[np.integer], orders: Orders, *, outside: int
) -> Groups:
    """Patches of one name each are a group; word `outside` is "outside the projector's image"."""
    known, owner = np.unique(names, return_inverse=True)
    by_weight = np.lexsort((patches.pixels, owner))
    heaviest = by_weight[np.searchsorted(owner[by_weight], np.arange(len(known)), "right") - 1]
    base = patches.turn[heaviest][owner]
    starts = np.arange(len(orders.words))
    padded = np.pad(orders.words, 1, constant_values=outside)
    relative = (patches.turn - base)[:, None]
    word = padded[np.clip(1 + starts + relative, 0, len(padded) - 1)]
    shift = orders.first + starts - base[:, None]
    below = shift < patches.low[:, None] - NEARLY_TURNS
    above = shift > patches.high[:, None] + NEARLY_TURNS
    return Groups(owner, base, len(known), word.astype(np.int32), ~(below | above))


@dataclass(frozen=True, slots=True)
class Said:
    """What the patches say, whoever they belong to.

    Attributes
    ----------
    fit
        ``(patches, transfers, words + 1)`` log-likelihood; of "outside" that of the worst word.
    noise
        ``(patches,)``: variance within the bins of the patch's region, over what the camera's
        noise explains. The phase's own noise is in it.
    excess
        ``(patches,)``: misfit beyond that noise, in its units, if each patch may choose its word,
        so that it holds whether or not the words follow each other.
    transfer
        ``(patches,)``: the transfer that goes with that.
    samples
        Independent samples of the model's error along a fringe.
    """

    fit: Array
    noise: Array
    excess: Array
    transfer: NDArray[np.intp]
    samples: float

    def too_sure(self, rows: Array) -> Array:
        """By how much the likelihood of patches is too sure; `rows` pixels share their misfit."""
        return self.noise * (1 + self.excess * np.maximum(rows, 1))

    def of_starts(self, groups: Groups, transfer: NDArray[np.intp], scale: Array) -> Array:
        """Log-likelihood ``(patches, starts)``, for patches of these transfers.

        Where a surface is steep a camera pixel blurs more of the code: a patch may depart from its
        transfer, at the usual cost.
        """
        steps = (np.arange(self.fit.shape[1]) - transfer[:, None]).astype(np.float32)
        scores = np.divide(self.fit, scale[:, None, None], dtype=np.float32)
        words = _most(scores - (np.float32(BLUR_NATS) * np.square(steps))[:, :, None], 1)
        return np.asarray(words[np.arange(len(words))[:, None], groups.word])


def hear(patches: Patches, fit: Array, flat: Array, regions: Groups, samples: float) -> Said:
    """The noise and the model's error of each region; arguments as `starts.find_starts`."""
    within, freedom = _scatter(patches)
    pixels = np.maximum(regions.total(patches.pixels), 1)
    noise = (regions.total(within) + FEW_PIXELS) / (regions.total(freedom) + FEW_PIXELS)
    misfit = flat[:, None] - 2 * _most(fit, 2)
    of_transfer = np.stack([regions.total(column) for column in misfit.T])
    excess = np.maximum(of_transfer.min(axis=0) / (pixels * noise) - 1, 0)
    return Said(
        np.concatenate([fit, -_most(-fit, 2)[:, :, None]], axis=2),
        noise[regions.owner],
        excess[regions.owner],
        of_transfer.argmin(axis=0)[regions.owner],
        samples,
    )


def _most(values: Array, axis: int) -> Array:
    """Largest along a short axis; numpy is ten times as fast along the first."""
    return np.asarray(np.ascontiguousarray(np.moveaxis(values, axis, 0)).max(axis=0))


def _scatter(patches: Patches) -> tuple[Array, Array]:
    """Weighted squares of c about the means of its bins ``(patches,)``, and their freedom."""
    filled = patches.weight > 0
    means = np.divide(
        np.square(patches.code), patches.weight, where=filled, out=np.zeros_like(patches.code)
    )
    within = np.maximum(patches.square - means.sum(axis=1), 0)
    return within, np.maximum(patches.pixels - np.count_nonzero(filled, axis=1), 0)


@dataclass(frozen=True, slots=True)
class Judged:
    """Per group: its start, by how much that leads, and the transfer that goes with it.

    `elsewhere`: a start outside the window is so much likelier that none inside can be it.
    """

    start: NDArray[np.intp]
    nats: Array
    transfer: NDArray[np.intp]
    elsewhere: NDArray[np.bool_]


def judge(patches: Patches, said: Said, groups: Groups) -> Judged:
    """The likeliest start of each group that the window admits."""
    score, barred = _score(patches, said.fit, groups)
    rows = groups.total(patches.pixels) / (said.samples * _fringes_of(patches, groups))
    scale = np.ones(groups.count, np.float32)
    scale[groups.owner] = said.too_sure(rows[groups.owner])  # a group's patches share a region
    score /= scale[:, None, None]
    inside = np.where(barred[:, None, :], NEVER, score)
    cost = _blur_costs(inside)
    free = (score - cost).max(axis=(1, 2))
    inside -= cost
    start, nats = _choose(inside.max(axis=1))
    elsewhere = free - inside.max(axis=(1, 2)) > OUTSIDE_WINDOW_NATS
    nats[elsewhere] = np.nan
    transfer = inside[np.arange(len(start)), :, start].argmax(axis=1)
    return Judged(start, nats, transfer, elsewhere)


def _score(patches: Patches, fit: Array, groups: Groups) -> tuple[Array, NDArray[np.bool_]]:
    """Log-likelihood ``(groups, transfers, starts)``, and the starts that the window bars."""
    starts = groups.word.shape[1]
    score = np.zeros((groups.count, fit.shape[1], starts), np.float32)
    votes = np.zeros((groups.count, starts), np.float32)
    owner = groups.owner.astype(np.int32)
    score_starts(fit, owner, groups.word, groups.allowed, patches.pixels, score, votes)
    return score, votes < WINDOW_SHARE * groups.total(patches.pixels)[:, None]


def _fringes_of(patches: Patches, groups: Groups) -> Array:
    """How many fringes each group shows."""
    turn = patches.turn - patches.turn.min()
    turns = int(turn.max()) + 1
    seen = np.unique(groups.owner * turns + turn) // turns
    return np.bincount(seen, minlength=groups.count).astype(np.float32)


def _blur_costs(score: Array) -> Array:
    """``(transfers, 1)``: what a group's blur costs that differs from the whole image's."""
    of_image = np.maximum(score.max(axis=2), NEVER / len(score)).sum(axis=0).argmax()
    steps = np.arange(score.shape[1]) - of_image
    return np.asarray(np.float32(BLUR_NATS) * np.square(steps, dtype=np.float32)[:, None])


def _choose(score: Array) -> tuple[NDArray[np.intp], Array]:
    """The best of each row and by how much it leads all others together; NaN: not enough."""
    rows, best = np.arange(len(score)), score.argmax(axis=1)
    top = score[rows, best]
    others = np.exp(np.maximum(score - top[:, None], NEVER))
    others[rows, best] = 0
    lead = -np.log(np.maximum(others.sum(axis=1), np.exp(-MOST_NATS)))
    return best, np.where((lead >= LEAST_NATS) & (top > NEVER / 2), lead, np.float32(np.nan))
