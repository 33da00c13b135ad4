"""Light on surfaces: from the projector to the camera, and from one surface to another."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.compiled import kernel

Array = NDArray[np.float64]


@kernel
def dot(a: Array, b: Array, i: int, j: int) -> float:
    """Product of row i of `a` and row j of `b`, both ``(n, 3)``."""
    return float(a[i, 0] * b[j, 0] + a[i, 1] * b[j, 1] + a[i, 2] * b[j, 2])


@kernel
def distance(a: Array, b: Array, i: int, j: int) -> float:
    """Distance of row i of `a` and row j of `b`, both ``(n, 3)``."""
    x, y, z = a[i, 0] - b[j, 0], a[i, 1] - b[j, 1], a[i, 2] - b[j, 2]
    return math.sqrt(x * x + y * y + z * z)


@kernel
def reflect_light(
    surfaces: tuple[Array, Array, Array, NDArray[np.int16]],
    eyes: Array,
    lights: Array,
    materials: Array,
    out: Array,
) -> None:
    """Radiance factor times cosine over squared distance, per point; zero where unlit.

    `surfaces` are points and normals ``(n, 3)``, albedo and object ``(n,)``; `eyes` and `lights`
    ``(n, 3)`` where each is seen and lit from; `materials` gloss and exponent ``(objects, 2)``.
    The factor is ``albedo + gloss (e + 2) / 2 cos^e``, the angle being between the mirror's
    direction and the eye (Phong; a perfect white diffuser has 1).
    """
    points, normals, albedo, objects = surfaces
    for i in range(len(points)):
        out[i] = 0.0
        if objects[i] < 0:
            continue
        far = distance(lights, points, i, i)
        cosine = (dot(lights, normals, i, i) - dot(points, normals, i, i)) / far
        if not cosine > 0:
            continue
        factor = albedo[i]
        gloss, exponent = materials[objects[i], 0], materials[objects[i], 1]
        if gloss > 0:
            eye = distance(eyes, points, i, i)
            mirrored = 0.0
            for c in range(3):
                turned = 2 * cosine * normals[i, c] - (lights[i, c] - points[i, c]) / far
                mirrored += turned * (eyes[i, c] - points[i, c]) / eye
            if mirrored > 0:
                factor += gloss * (exponent + 2) / 2 * mirrored**exponent
        out[i] = factor * cosine / (far * far)


@kernel
def exchange_light(
    senders: tuple[Array, Array, Array], receivers: tuple[Array, Array], out: NDArray[np.float32]
) -> None:
    """Form factors ``(receivers, senders)``: irradiance for unit radiosity of small patches.

    `senders` are points and normals ``(n, 3)`` and areas ``(n,)``, mm^2; `receivers` points and
    normals. A patch of area S counts as the disc that it looks like from the front,
    ``cos cos S / (pi r^2 + S)``, which stays below one however near it is.
    """
    places, facings, areas = senders
    points, normals = receivers
    for i in range(len(points)):
        for j in range(len(places)):
            far = distance(points, places, i, j)
            at_receiver = dot(places, normals, j, i) - dot(points, normals, i, i)
            at_sender = dot(points, facings, i, j) - dot(places, facings, j, j)
            out[i, j] = 0.0
            if at_receiver > 0 and at_sender > 0:
                cosines = at_receiver * at_sender / (far * far)
                out[i, j] = cosines * areas[j] / (math.pi * far * far + areas[j])
