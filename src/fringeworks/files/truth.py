"""Read and write ``truth.npz``: what the twin knows of each camera pixel."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import FormatError, UsageError
from fringeworks.files.npz import Arrays, read_npz, write_npz

if TYPE_CHECKING:
    from fringeworks.twin.truth import Truth

_MAPS = ("xyz", "column", "row", "surface")
_NAMES = "names"


def write_truth(path: str | Path, truth: Truth) -> None:
    """Write the maps of a truth and the names of its surfaces, atomic.

    Raises
    ------
    UsageError
        The suffix is not ``.npz``.
    FormatError
        The file cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() != ".npz":
        raise UsageError(f"truths are written as .npz, got '{path.name}'")
    arrays: Arrays = {name: getattr(truth, name) for name in _MAPS}
    write_npz(path, {**arrays, _NAMES: np.array(truth.names, dtype=np.str_)})


def read_truth(path: str | Path) -> Truth:
    """The truth of a ``truth.npz``.

    Raises
    ------
    FormatError
        Not an archive, an array missing, of another type or shape, or a surface without a name.
    """
    from fringeworks.twin.truth import Truth  # brings numba

    path = Path(path)
    arrays = read_npz(path, (*_MAPS, _NAMES))
    missing = [name for name in (*_MAPS, _NAMES) if name not in arrays]
    if missing:
        raise FormatError(f"{path}: holds no {', '.join(missing)}; is it a truth of the twin?")
    shape = arrays["column"].shape
    if len(shape) != 2 or 0 in shape:
        raise FormatError(f"{path}: column must be (H, W), got shape {shape}")
    names = _names(arrays[_NAMES], path)
    return Truth(
        xyz=_numbers(path, arrays, "xyz", (*shape, 3)),
        column=_numbers(path, arrays, "column", shape),
        row=_numbers(path, arrays, "row", shape),
        surface=_surface(path, arrays["surface"], shape=shape, count=len(names)),
        names=names,
    )


def _names(array: NDArray[Any], path: Path) -> tuple[str, ...]:
    if array.ndim != 1 or array.dtype.kind != "U":
        raise FormatError(f"{path}: names must be a list of texts, got {_kind(array)}")
    return tuple(str(name) for name in array)


def _numbers(path: Path, arrays: Arrays, name: str, shape: tuple[int, ...]) -> NDArray[np.float64]:
    array = arrays[name]
    if array.shape != shape or array.dtype != np.float64:
        raise FormatError(f"{path}: {name} must be float64 of {shape}, got {_kind(array)}")
    return array


def _surface(
    path: Path, array: NDArray[Any], *, shape: tuple[int, ...], count: int
) -> NDArray[np.int16]:
    if array.shape != shape or array.dtype != np.int16:
        raise FormatError(f"{path}: surface must be int16 of {shape}, got {_kind(array)}")
    if array.min() < -1 or array.max() >= count:
        raise FormatError(
            f"{path}: surface must be -1 (none) to {count - 1}, one for each of names, got "
            f"{array.min()} to {array.max()}"
        )
    return array


def _kind(array: NDArray[Any]) -> str:
    return f"{array.dtype} of {array.shape}"
