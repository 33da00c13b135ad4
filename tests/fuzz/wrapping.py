"""Spoil what stands behind a checksum or a packing, and set that right again.

Without this most changes would stop at the first checksum, and what lies behind were not tried.
"""

from __future__ import annotations

import io
import struct
import zipfile
import zlib
from collections.abc import Callable
from random import Random

from tests.fuzz.mutate import mutate

Spoil = Callable[[bytes, Random], bytes]


def behind(wrapped: Spoil) -> Spoil:
    """Changes of the plain bytes as often as those behind the wrapping."""

    def spoil(content: bytes, random: Random) -> bytes:
        return (mutate if random.random() < 0.3 else wrapped)(content, random)

    return spoil


def spoil_png(content: bytes, random: Random) -> bytes:
    """A PNG whose chunks have other contents, with their checksums."""
    head, chunks = content[:8], []
    place = 8
    while place < len(content):
        size = int.from_bytes(content[place : place + 4], "big")
        chunks.append([content[place + 4 : place + 8], content[place + 8 : place + 8 + size]])
        place += 12 + size
    chosen = random.choice(chunks)
    if chosen[0] == b"IDAT" and random.random() < 0.5:
        chosen[1] = zlib.compress(mutate(zlib.decompress(chosen[1]), random))
    else:
        chosen[random.choice((0, 1, 1, 1, 1))] = mutate(chosen[1], random)
    out = [head]
    for kind, data in chunks:
        named = (kind[:4].ljust(4, b"x")) + data
        out.append(len(data).to_bytes(4, "big") + named + zlib.crc32(named).to_bytes(4, "big"))
    return b"".join(out)


def spoil_npz(content: bytes, random: Random) -> bytes:
    """An archive with one array spoilt, stored or packed anew."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    chosen = random.choice(list(members))
    members[chosen] = mutate(members[chosen], random)
    out = io.BytesIO()
    packing = random.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED))
    with zipfile.ZipFile(out, "w", packing) as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return out.getvalue()


def spoil_mat(content: bytes, random: Random) -> bytes:
    """A .mat with the content of its one packed part spoilt."""
    head = content[:128]
    kind, size = struct.unpack_from("<II", content, 128)
    packed = zlib.compress(mutate(zlib.decompress(content[136 : 136 + size]), random))
    return head + struct.pack("<II", kind, len(packed)) + packed


PAGE, SUM = 1024, 4
"""Bytes of a page of an E57 file, and of the checksum at its end."""


def spoil_e57(content: bytes, random: Random) -> bytes:
    """An E57 with its pages' contents spoilt, and their checksums right."""
    pages = [content[start : start + PAGE - SUM] for start in range(0, len(content), PAGE)]
    # The XML stands behind the points: half of the changes are made there.
    plain = b"".join(pages)
    split = max(plain.find(b"<?xml"), 0) if random.random() < 0.5 else 0
    spoilt = plain[:split] + mutate(plain[split:], random)
    if random.random() < 0.7:  # of the length that the header tells
        spoilt = spoilt[: len(plain)].ljust(len(plain), b" ")
    out = []
    for start in range(0, len(spoilt), PAGE - SUM):
        page = spoilt[start : start + PAGE - SUM].ljust(PAGE - SUM, b"\0")
        out.append(page + crc32c(page).to_bytes(SUM, "big"))
    return b"".join(out)


def _crc_table() -> list[int]:
    table = []
    for byte in range(256):
        value = byte
        for _ in range(8):
            value = value >> 1 ^ (0x82F63B78 if value & 1 else 0)
        table.append(value)
    return table


_TABLE = _crc_table()


def crc32c(data: bytes) -> int:
    """Castagnoli's checksum (RFC 3720, B.4)."""
    value = 0xFFFFFFFF
    for byte in data:
        value = _TABLE[(value ^ byte) & 255] ^ value >> 8
    return value ^ 0xFFFFFFFF
