"""MATLAB files of versions 5 to 7: numbers, and structs of them; everything else is skipped.

MathWorks, "MAT-File Format". In Python alone, since scipy's reader believes what a file says of
itself: a damaged or hostile one can end the whole process. Here every length is held against the
bytes that there are, and unpacking ends at `MAX_UNPACKED`.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Struct: TypeAlias = "dict[str, Value]"
Value: TypeAlias = "NDArray[np.float64] | Struct | None"

MAX_UNPACKED = 64 * 2**20
"""Bytes of all parts together, unpacked."""

MAX_DEPTH = 8
"""Structs within structs."""

HEADER_BYTES = 128
VERSION_73 = 0x0200

_MATRIX, _PACKED = 14, 15
_NUMBERS = {
    1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8",
}  # fmt: skip
_STRUCT, _NUMERIC = 2, range(6, 16)
_COMPLEX = 0x0800


class MatError(ValueError):
    """The bytes are no such file: what is wrong with them, without its name."""


@dataclass(frozen=True, slots=True)
class _Part:
    """A data element: its kind, and its bytes."""

    kind: int
    data: bytes


def parse_mat(content: bytes) -> dict[str, Value]:
    """Numbers (float64, as they are shaped, Fortran's order undone) and structs by their names.

    A struct is a dict of its fields. Texts, cells, objects, complex and sparse numbers, and arrays
    of structs are None.

    Raises
    ------
    MatError
        Damaged, cut off, of version 7.3, too deep, or larger than `MAX_UNPACKED` unpacked.
    """
    order = {b"IM": "<", b"MI": ">"}.get(content[HEADER_BYTES - 2 : HEADER_BYTES])
    if order is None:
        raise MatError("its header is none")
    number = np.frombuffer(content[HEADER_BYTES - 4 : HEADER_BYTES - 2], f"{order}u2")[0]
    if number == VERSION_73:
        raise MatError("version 7.3 is not read: save it again with -v7")
    found = {}
    for part in _unpacked(_parts(content[HEADER_BYTES:], order), order):
        if part.kind == _MATRIX:
            name, value = _matrix(part.data, order, depth=0)
            found[name] = value
    return found


def _parts(data: bytes, order: str) -> Iterator[_Part]:
    place = 0
    while place < len(data):
        if place + 8 > len(data):
            raise MatError("cut off")
        first, second = (int(word) for word in np.frombuffer(data, f"{order}u4", 2, place))
        if first >> 16:  # up to four bytes stand in the tag itself
            kind, size, start, end = first & 0xFFFF, first >> 16, place + 4, place + 8
        else:
            kind, size, start = first, second, place + 8
            end = start + size + (0 if kind == _PACKED else -size % 8)
        if start + size > len(data) or (first >> 16 and size > 4):
            raise MatError(f"cut off: a part of {size} bytes is not there")
        yield _Part(kind, data[start : start + size])
        place = end


def _unpacked(parts: Iterator[_Part], order: str) -> Iterator[_Part]:
    """The same parts, those in zlib's packing unpacked."""
    left = MAX_UNPACKED
    for part in parts:
        if part.kind != _PACKED:
            yield part
            continue
        unpacker = zlib.decompressobj()
        try:
            data = unpacker.decompress(part.data, left + 1)
        except zlib.error as error:
            raise MatError(str(error)) from None
        left -= len(data)
        if left < 0:
            raise MatError(f"more than {MAX_UNPACKED} bytes unpacked")
        if not unpacker.eof:
            raise MatError("a packed part is cut off")
        yield from _parts(data, order)


def _matrix(data: bytes, order: str, depth: int) -> tuple[str, Value]:
    """Name and value of an array."""
    if not data:  # how a field says that it is empty
        return "", None
    parts = list(_parts(data, order))
    if len(parts) < 3:
        raise MatError("an array without flags, shape or name")
    flags, shape = _numbers(parts[0], order), _shape(parts[1], order)
    if not len(flags):
        raise MatError("an array without flags")
    kind = int(flags[0]) & 0xFF
    name = parts[2].data.decode("ascii", errors="replace")
    if kind == _STRUCT and math.prod(shape) == 1:
        return name, _struct(parts[3:], order, depth)
    if kind in _NUMERIC and not int(flags[0]) & _COMPLEX and len(parts) > 3:
        values = _numbers(parts[3], order)
        if len(values) != math.prod(shape):
            raise MatError(f"{len(values)} numbers in an array of {shape}")
        return name, values.reshape(shape, order="F")
    return name, None


def _struct(parts: list[_Part], order: str, depth: int) -> Struct:
    if depth == MAX_DEPTH:
        raise MatError(f"more than {MAX_DEPTH} structs within each other")
    width = _numbers(parts[0], order) if len(parts) > 1 else np.zeros(0)
    if width.size != 1 or not 0 < width[0] <= 1024:
        raise MatError("a struct without names of fields")
    size, text = int(width[0]), parts[1].data
    names = [text[start : start + size].split(b"\0")[0] for start in range(0, len(text), size)]
    values = parts[2:]
    if len(values) != len(names) or any(part.kind != _MATRIX for part in values):
        raise MatError(f"{len(values)} values for {len(names)} fields")
    return {
        name.decode("ascii", errors="replace"): _matrix(part.data, order, depth + 1)[1]
        for name, part in zip(names, values, strict=True)
    }


def _shape(part: _Part, order: str) -> tuple[int, ...]:
    sides = tuple(int(side) for side in _numbers(part, order))
    if not 2 <= len(sides) <= 32 or min(sides) < 0:
        raise MatError(f"an array of {len(sides)} dimensions")
    return sides


def _numbers(part: _Part, order: str) -> NDArray[np.float64]:
    name = _NUMBERS.get(part.kind)
    if name is None or len(part.data) % int(name[1]):
        raise MatError(f"kind {part.kind} of {len(part.data)} bytes is no list of numbers")
    return np.frombuffer(part.data, f"{order}{name}").astype(np.float64)
