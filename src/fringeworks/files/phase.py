"""Read and write ``phase.npz``: what `decode` finds at each camera pixel."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import FormatError, UsageError
from fringeworks.files.npz import Arrays, read_npz, write_npz
from fringeworks.model.phase import CodedAxis, WrappedPhase

if TYPE_CHECKING:
    from fringeworks.phase.decode import Decoding

COORDINATES = {"x": "column", "y": "row"}
WRAPPED = ("wrapped_x", "wrapped_y")

_MAPS = (
    *COORDINATES.values(),
    "offset",
    *(
        f"{name}_{axis}"
        for name in ("sigma_px", "modulation", "wrapped", "order", "margin")
        for axis in COORDINATES
    ),
)


def write_phase(path: str | Path, decoding: Decoding) -> None:
    """Write the maps of all coded axes, ``(H, W)`` each; atomic.

    Per axis: ``column`` (x) or ``row`` (y), projector px; ``sigma_px_x``; ``modulation_x``, grey
    levels; and where there are fringes the finest ones' ``wrapped_x``, rad, ``order_x`` (int32,
    -1 where void; a true -1, left of `zero_px`, has a finite margin) and ``margin_x``.
    ``offset``, grey levels, is that of the first axis. NaN where void.

    An axis whose orders nothing tells has its finest fringes' ``wrapped_x``,
    ``modulation_x`` and ``sigma_px_x`` alone.

    Raises
    ------
    UsageError
        The suffix is not ``.npz``, or there is no axis at all.
    FormatError
        The file cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() != ".npz":
        raise UsageError(f"phases are written as .npz, got '{path.name}'")
    relative = [wrapped for wrapped, _ in decoding.relative]
    offsets = [coded.offset for coded in decoding.coded] + [fringe.offset for fringe in relative]
    if not offsets:
        raise UsageError("there is no axis to write: the capture codes none")
    arrays: Arrays = {"offset": offsets[0]}
    for axis in decoding.coded:
        arrays.update(_axis_arrays(axis))
    for wrapped in relative:
        arrays.update(_relative_arrays(wrapped))
    write_npz(path, arrays)


def _relative_arrays(wrapped: WrappedPhase) -> Arrays:
    axis = wrapped.fringe.axis
    pixels_per_radian = np.float32(wrapped.fringe.period_px / (2 * np.pi))
    return {
        f"wrapped_{axis}": wrapped.phase,
        f"modulation_{axis}": wrapped.modulation,
        f"sigma_px_{axis}": wrapped.sigma * pixels_per_radian,
    }


def _axis_arrays(coded: CodedAxis) -> Arrays:
    axis = coded.axis
    arrays: Arrays = {
        COORDINATES[axis]: coded.coordinate,
        f"sigma_px_{axis}": coded.sigma,
        f"modulation_{axis}": coded.modulation,
    }
    if coded.phase is not None:
        arrays[f"wrapped_{axis}"] = coded.phase.wrapped.phase
        arrays[f"order_{axis}"] = coded.phase.order.astype(np.int32, copy=False)
        arrays[f"margin_{axis}"] = coded.phase.margin
    return arrays


def read_phase(path: str | Path) -> dict[str, NDArray[Any]]:
    """The maps of a ``phase.npz`` by the names that `write_phase` gives them.

    Raises
    ------
    FormatError
        Not an archive, neither a coordinate nor a wrapped phase in it, or maps of different
        shapes.
    """
    path = Path(path)
    arrays = read_npz(path, _MAPS)
    coordinates = [name for name in (*COORDINATES.values(), *WRAPPED) if name in arrays]
    if not coordinates:
        raise FormatError(f"{path}: holds neither column nor row; is it a file of `decode`?")
    shape = arrays[coordinates[0]].shape
    for name, array in arrays.items():
        if array.ndim != 2 or array.shape != shape:
            raise FormatError(
                f"{path}: {name} must be a map of shape {shape}, got {array.shape}"
                if len(shape) == 2
                else f"{path}: {coordinates[0]} must be (H, W), got shape {shape}"
            )
    return arrays
