"""Hostile changes of a valid file's bytes; every choice comes from a `Random`, and so from a seed.

The same changes serve text and binary files: numbers and words are found wherever they stand.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from random import Random

MOST_BYTES = 2**20
"""Largest spoilt file: what grows out of less is the reader's doing."""

INTEGERS: tuple[int, ...] = (
    0,
    1,
    -1,
    2,
    3,
    127,
    128,
    255,
    256,
    32767,
    65535,
    65536,
    89_478_485,
    10**9,
)
INTEGERS += (2**31 - 1, -(2**31), 2**32 - 1, 2**53 + 1, 2**63 - 1, -(2**63), 2**64 - 1)

NUMBERS = [str(value).encode() for value in INTEGERS]
NUMBERS += [b"nan", b"-inf", b"inf", b"NaN", b"Infinity", b".nan", b"1e308", b"-1e308", b"1e999"]
NUMBERS += [b"1e-320", b"0.5", b"-0.0", b"1e9", b"0x10", b"1_000", b"", b"9" * 400, b"9" * 5000]

WORDS = [b"../../../../etc/passwd", b"/etc/passwd", b"..", b".", b"/", b"", b"/dev/zero", b"\0"]
WORDS += [
    b"a\0b",
    b"a\\u0000b",
    b"~/x",
    b"C:\\\\x",
    b"\\\\\\\\host\\\\x",
    b"x" * 300,
    b"x" * 70_000,
]
WORDS += [b"\xff\xfe", b"\xed\xa0\x80", b"\\ud800", b"\xe2\x80\xae", b"link.png", b"loop.png"]
WORDS += [b"fringe", b"uint8", b"float64", b"double", b"list", b"binary", b"ascii", b"O", b"|O"]
WORDS += [b"true", b"null", b"{}", b"[]", b'{"a":1}', b"format", b"x", b"y", b"%n%s", b"$(id)"]

NESTS = (
    (b"[", b"]"),
    (b"{", b"}"),
    (b'{"a":', b"}"),
    (b"{a=", b"}"),
    (b"<a>", b"</a>"),
    (b"(", b""),
)

_NUMBER = re.compile(rb"[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?")
_WORD = re.compile(rb"\"[^\"\n]*\"|'[^'\n]*'|[A-Za-z_][\w./-]*")

Change = Callable[[bytes, Random], bytes]


def mutate(content: bytes, random: Random) -> bytes:
    """One to four changes of `content`, at most `MOST_BYTES` long."""
    for _ in range(random.choice((1, 1, 1, 2, 4))):
        content = random.choice(CHANGES)(content, random)[:MOST_BYTES]
    return content


def _place(content: bytes, random: Random) -> int:
    """Anywhere; in half of the cases in the first bytes, where headers are."""
    most = min(len(content), 256) if random.random() < 0.5 else len(content)
    return random.randint(0, most)


def _stretch(content: bytes, random: Random, most: int = 64) -> tuple[int, int]:
    start = _place(content, random)
    return start, min(len(content), start + random.randint(1, most))


def flip(content: bytes, random: Random) -> bytes:
    """Some bytes are others."""
    changed = bytearray(content)
    for _ in range(random.randint(1, 8)):
        place = _place(content, random)
        if place < len(changed):
            changed[place] ^= random.choice((1, 2, 4, 8, 16, 32, 64, 128, 255))
    return bytes(changed)


def cut(content: bytes, random: Random) -> bytes:
    """The end is missing."""
    return content[: random.randint(0, len(content))]


def drop(content: bytes, random: Random) -> bytes:
    """A stretch is missing."""
    start, end = _stretch(content, random)
    return content[:start] + content[end:]


def splice(content: bytes, random: Random) -> bytes:
    """A stretch stands elsewhere too, between or over what was there."""
    start, end = _stretch(content, random, 512)
    place = _place(content, random)
    rest = place if random.random() < 0.5 else place + end - start
    return content[:place] + content[start:end] + content[rest:]


def repeat(content: bytes, random: Random) -> bytes:
    """A stretch stands there many times."""
    start, end = _stretch(content, random, 512)
    times = random.choice((2, 3, 10, 100, 2000))
    return content[:end] + content[start:end] * times + content[end:]


def integer(content: bytes, random: Random) -> bytes:
    """One to eight bytes are an integer at some edge."""
    size = random.choice((1, 2, 4, 8))
    value = random.choice(INTEGERS) % (1 << 8 * size)
    place = _place(content, random)
    data = value.to_bytes(size, "little" if random.random() < 0.5 else "big")
    return content[:place] + data + content[place + size :]


def number(content: bytes, random: Random) -> bytes:
    """A number in figures is another one, or none."""
    return _replace(content, random, _NUMBER, NUMBERS)


def word(content: bytes, random: Random) -> bytes:
    """A word or a text in quotes is another one."""
    return _replace(content, random, _WORD, WORDS, quoted=True)


def _replace(
    content: bytes, random: Random, what: re.Pattern[bytes], by: list[bytes], quoted: bool = False
) -> bytes:
    start = _place(content, random)
    found = what.search(content, start) or what.search(content)
    if found is None:
        return content
    new = random.choice(by)
    mark = found.group()[:1]
    if quoted and mark in b"\"'" and random.random() < 0.9:
        new = mark + new + mark
    return content[: found.start()] + new + content[found.end() :]


def line(content: bytes, random: Random) -> bytes:
    """A line stands twice, elsewhere, or not at all."""
    lines = content.split(b"\n")
    first, other = random.randrange(len(lines)), random.randrange(len(lines))
    kept = lines[first]
    if random.random() < 0.6:
        del lines[first]
    if random.random() < 0.7:
        lines.insert(other, kept)
    return b"\n".join(lines)


def nest(content: bytes, random: Random) -> bytes:
    """Brackets in brackets, closed or not."""
    opening, closing = random.choice(NESTS)
    depth = random.choice((5, 99, 1000, 20_000))
    place = _place(content, random)
    middle = b"1" if random.random() < 0.5 else b""
    inner = opening * depth + middle + closing * (depth if random.random() < 0.7 else 0)
    return content[:place] + inner + content[place:]


def swell(content: bytes, random: Random) -> bytes:
    """One byte, tens of thousands of times."""
    place = _place(content, random)
    filler = random.choice(
        (b"\0", b" ", b"\n", b"a", b'"', b"\\", b'\\"', b".", b"a.", b"\xff", b"1")
    )
    return content[:place] + filler * random.choice((1000, 100_000)) + content[place:]


CHANGES: tuple[Change, ...] = (
    *(flip, flip, cut, drop, splice, splice, repeat, integer, integer),
    *(number, number, number, word, word, line, line, nest, swell),
)
