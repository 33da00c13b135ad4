"""What to change before frames are taken: checks of a capture, and what only test frames show."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.diagnose.blur import find_blur
from fringeworks.diagnose.exposure import find_ambient, find_darkness, find_saturation
from fringeworks.diagnose.frame_errors import fit_frame_errors
from fringeworks.diagnose.light import find_flicker
from fringeworks.diagnose.look import Look
from fringeworks.diagnose.suspicion import Suspicion
from fringeworks.model import Capture, Finding, FloatMap

Bits = NDArray[np.bool_]

SPECK_PX = 9
"""Clipped patches that hold no square of this side are specks."""

LEAST_SPECKS, DULL_SHARE = 5e-4, 0.4
"""Share of the lit pixels that specks take, and of full scale that the median pixel reaches."""

LARGEST_BLUR_PX = 2.0
"""Projector px: beyond, the best fringes are wider than 12 px."""


@dataclass(frozen=True, slots=True, eq=False)
class Complaint:
    """Something to change, and the picture ``(H, W)`` that shows it."""

    name: str
    message: str
    remedy: str
    where: str
    picture: FloatMap
    label: str

    @property
    def finding(self) -> Finding:
        return Finding("warning", self.message, self.remedy, name=self.name, where=self.where)


def find_light(capture: Capture, looks: Sequence[Look], coarse: Look) -> Iterator[Complaint]:
    """The checks of exposure and light; several sets with one fault are one complaint.

    Darkness and saturation are judged by the coarsest fringes, which no blur makes faint.
    """
    errors = {look.place: found for look in looks if (found := fit_frame_errors(look))}
    suspected = [
        *find_ambient(capture, looks),
        *find_darkness(capture, [coarse]),
        *find_saturation(capture, [coarse]),
        *find_flicker(looks, errors),
    ]
    worst: dict[str, Suspicion] = {}
    for item in sorted(suspected, key=lambda item: item.cost_px):
        worst[item.name] = item
    if "saturation" in worst:
        worst.pop("flicker", None)  # clipped frames differ in their light
    yield from map(complain, worst.values())


def find_gloss(capture: Capture, coarse: Look) -> Iterator[Complaint]:
    """Specks that are clipped while most of the scene is dark."""
    import cv2

    seen = coarse.lit | coarse.clipped
    if not seen.any():
        return
    bright = coarse.frames.max(axis=0)
    clipped = (bright >= capture.sensor.saturation).astype(np.uint8)
    patches = cv2.morphologyEx(clipped, cv2.MORPH_OPEN, np.ones((SPECK_PX, SPECK_PX), np.uint8))
    specks: Bits = (clipped > 0) & (np.asarray(patches) == 0)
    share = np.count_nonzero(specks) / np.count_nonzero(seen)
    median = float(np.median(bright[seen])) / capture.sensor.full_scale
    if share > LEAST_SPECKS and median < DULL_SHARE:
        yield Complaint(
            "gloss",
            f"specks that take {share:.1%} of the lit pixels are saturated while the median pixel "
            f"reaches {median:.0%} of full scale: the scene is glossy.",
            "Turn the object so that no mirror image of the projector falls into the camera, put "
            "crossed polarisers before both, spray it matt, or take the exposures below.",
            coarse.where,
            np.where(seen, bright, np.nan).astype(np.float32),
            "brightest frame, grey levels",
        )


def find_defocus(
    capture: Capture, looks: Sequence[Look], sigmas_px: Mapping[str, float]
) -> Iterator[Complaint]:
    """The check of blur; besides, a blur that asks for fringes wider than 12 px."""
    found = [*find_blur(capture, looks)]
    if found:
        yield complain(max(found, key=lambda item: item.cost_px))
        return
    for axis, sigma in sigmas_px.items():
        if sigma > LARGEST_BLUR_PX and looks:
            yield Complaint(
                "blur",
                f"the blur along {axis} is {sigma:.1f} projector px: least noise takes fringes of "
                f"{2 * np.pi * sigma:.0f} px.",
                "Focus projector and camera on the scene, or stop the lenses down.",
                f"along {axis}",
                looks[0].modulation,
                "modulation, grey levels",
            )
            return


def complain(item: Suspicion) -> Complaint:
    """A check's suspicion, without its cost: nothing has been measured yet."""
    return Complaint(item.name, item.message, item.remedy, item.where, item.picture, item.label)
