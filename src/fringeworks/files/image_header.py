"""What an image file says of itself, and whether all of it is there; no pixel is decoded.

Pillow reads the header. A size beyond `MAX_PIXELS` is refused before anything of that size is
allocated, and a file that was cut off is refused before a decoder could fill in what is missing.
"""

from __future__ import annotations

import re
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fringeworks.errors import FormatError
from fringeworks.files.system import check_file
from fringeworks.files.validation import clip
from fringeworks.model.capture import MAX_PIXELS

if TYPE_CHECKING:
    from PIL.ImageFile import ImageFile

MAX_FILE_BYTES = 2**30

_FORMATS = ("PNG", "TIFF", "BMP", "PPM", "JPEG")
_KNOWN = "PNG, TIFF, BMP, binary PGM or JPEG"
_CHANNELS = {"1": 1, "L": 1, "I": 1, "I;16": 1, "I;16B": 1, "LA": 2, "P": 3, "RGB": 3, "RGBA": 4}

_TIFF_COMPRESSION, _TIFF_ORIENTATION, _TIFF_BITS, _TIFF_SAMPLE_FORMAT = 259, 274, 258, 339
_TIFF_PIECES = ((273, 279), (324, 325))  # offsets and byte counts of strips, of tiles
_TIFF_JPEG = (6, 7, 34892)
_CUT_TAGS = re.compile("truncated|corrupt", re.IGNORECASE)  # what Pillow warns of and goes on


@dataclass(frozen=True, slots=True)
class ImageHeader:
    """Size and kind of an image file.

    `channels` is 1 grey, 2 grey and alpha, 3 colour (also palettes), 4 colour and alpha; `bits`,
    8 or 16, is the depth it is decoded to; `lossy` means that grey levels were changed (JPEG).
    """

    format: str
    width: int
    height: int
    bits: int
    channels: int
    lossy: bool = False

    @property
    def is_colour(self) -> bool:
        return self.channels > 2

    @property
    def grey_bytes(self) -> int:
        """Bytes of the decoded image, one channel."""
        return self.width * self.height * self.bits // 8


def inspect_image(path: Path) -> ImageHeader:
    """Read the header of `path` and check that the file is whole.

    Raises
    ------
    FormatError
        Missing, empty, not an image, cut off or damaged, more than `MAX_PIXELS`, several pages,
        other than 8 or 16 bit per channel, or turned by a TIFF orientation tag.
    """
    _check_file(path)
    # Whatever a decoder trips over (it raises a dozen unrelated types on damaged files) means
    # that the file is damaged.
    try:
        return _read_header(path)
    except FormatError:
        raise
    except Exception as error:
        raise FormatError(
            f"{path}: the image is cut off or damaged ({clip(error)}); copy or record it again"
        ) from error


def _check_file(path: Path) -> None:
    check_file(path)
    size = path.stat().st_size
    if size == 0:
        raise FormatError(f"{path}: the file is empty; copy or record it again")
    if size > MAX_FILE_BYTES:
        raise FormatError(f"{path}: the file is larger than any image that is read, {size} bytes")


def _read_header(path: Path) -> ImageHeader:
    from PIL import Image, UnidentifiedImageError

    with warnings.catch_warnings(record=True) as noticed:
        warnings.simplefilter("always")
        try:
            with Image.open(path, formats=_FORMATS) as image:
                header = _describe(path, image)
                _check_whole(path, image, header)
        except Image.DecompressionBombError as error:
            raise _too_large(path, str(error)) from None
        except UnidentifiedImageError:
            raise FormatError(_unidentified(path)) from None
    cut = [str(w.message) for w in noticed if _CUT_TAGS.search(str(w.message))]
    if header.format == "TIFF" and cut:
        raise FormatError(f"{path}: the TIFF is cut off ({cut[0]}); copy or record it again")
    return header


def _too_large(path: Path, what: str) -> FormatError:
    return FormatError(f"{path}: an image must have at most {MAX_PIXELS} pixels: {what}")


def _unidentified(path: Path) -> str:
    with path.open("rb") as file:
        start = file.read(8)
    magic = (b"\x89PNG", b"II*\0", b"MM\0*", b"BM", b"P5", b"P6", b"\xff\xd8\xff")
    if start.startswith(magic):
        return f"{path}: the image is cut off or damaged in its header; copy or record it again"
    return f"{path}: not an image; use {_KNOWN}"


def _describe(path: Path, image: ImageFile) -> ImageHeader:
    kind = {"PPM": "PGM", "MPO": "JPEG"}.get(str(image.format), str(image.format))
    if image.width * image.height > MAX_PIXELS:
        raise _too_large(path, f"{image.width}x{image.height}")
    if image.mode not in _CHANNELS and image.mode != "F":
        raise FormatError(f"{path}: grey or RGB is read, got {image.mode}; convert it to grey")
    header = ImageHeader(
        format=kind,
        width=image.width,
        height=image.height,
        bits=_bits(path, kind, image),
        channels=_CHANNELS.get(image.mode, 1),
        lossy=kind == "JPEG",
    )
    return _describe_tiff(path, image, header) if kind == "TIFF" else header


def _raw_mode(image: ImageFile) -> str:
    """Pillow's name for how the samples are packed in the file, such as ``RGB;16B``."""
    arguments: Any = image.tile[0][3]
    return str(arguments[0] if isinstance(arguments, tuple) else arguments)


def _bits(path: Path, kind: str, image: ImageFile) -> int:
    packing = _raw_mode(image)
    if kind == "TIFF":
        bits = max(_tags(image).get(_TIFF_BITS, (1,)))
    elif kind == "PGM":
        bits = _pgm_bits(path, image)
    elif kind == "BMP":  # 1, 4 and 16 bit BMP: palettes of a few colours, 5 bits per channel
        bits = 8 if ";" not in packing and image.mode != "1" else 4
    else:  # PNG of fewer than 8 bit is expanded to 8 without loss
        bits = 16 if "16" in packing else 8
    floating = image.mode == "F" or (
        kind == "TIFF" and any(value != 1 for value in _tags(image).get(_TIFF_SAMPLE_FORMAT, (1,)))
    )
    if bits not in (8, 16) or floating:
        what = "floating or signed numbers" if floating else f"{bits} bit"
        raise FormatError(f"{path}: images must be 8 or 16 bit per channel, got {what}")
    return int(bits)


def _pgm_bits(path: Path, image: ImageFile) -> int:
    arguments: Any = image.tile[0][3]
    if image.mode == "1" or image.tile[0][0] == "ppm_plain":
        raise FormatError(f"{path}: PGM must be binary (P5), 8 or 16 bit; save it as PNG")
    largest = arguments[1] if image.tile[0][0] == "ppm" else None
    if largest is not None:
        return 16 if largest > 255 else 8
    return 16 if image.mode.startswith("I") else 8


def _tags(image: ImageFile) -> Any:
    return image.tag_v2  # type: ignore[attr-defined]


def _describe_tiff(path: Path, image: ImageFile, header: ImageHeader) -> ImageHeader:
    tags = _tags(image)
    if tags.get(_TIFF_ORIENTATION, 1) != 1:
        raise FormatError(
            f"{path}: the TIFF orientation tag {tags[_TIFF_ORIENTATION]} would turn the camera's "
            "pixels; save it without"
        )
    pages = getattr(image, "n_frames", 1)
    if pages != 1:
        raise FormatError(f"{path}: one image per file is read, got a TIFF of {pages} pages")
    lossy = tags.get(_TIFF_COMPRESSION, 1) in _TIFF_JPEG
    return ImageHeader("TIFF", header.width, header.height, header.bits, header.channels, lossy)


def _check_whole(path: Path, image: ImageFile, header: ImageHeader) -> None:
    """Raise where bytes are missing: each format says in its own way how many there should be."""
    if header.format == "PNG":
        image.verify()  # walks the chunks and their checksums but for the last; raises
        whole = _PNG_END in path.read_bytes()
    elif header.format == "JPEG":
        whole = _ends(path.read_bytes())
    else:
        whole = _last_byte(image, header) <= path.stat().st_size
    if not whole:
        raise FormatError(f"{path}: the {header.format} is cut off; copy or record it again")


def _last_byte(image: ImageFile, header: ImageHeader) -> int:
    """Smallest file size that holds all pixel data, bytes."""
    if header.format == "TIFF":
        tags = _tags(image)
        ends = (
            start + count
            for starts, counts in _TIFF_PIECES
            for start, count in zip(tags.get(starts, ()), tags.get(counts, ()), strict=False)
        )
        return max(ends, default=0)
    per_pixel = 1 if image.mode == "P" else header.channels
    row = header.width * per_pixel * header.bits // 8
    if header.format == "BMP":
        row = -(-row // 4) * 4
    return int(image.tile[0][2]) + row * header.height


_PNG_END = b"IEND\xaeB\x60\x82"
_MARKER = re.compile(rb"\xff[\x02-\xcf\xd8-\xfe]")
_START, _END = 0xD8, 0xD9


def _ends(jpeg: bytes) -> bool:
    """Whether a walk over the JPEG's segments reaches its end marker."""
    position = 0
    while found := _MARKER.search(jpeg, position):
        marker, position = jpeg[found.start() + 1], found.end()
        if marker == _END:
            return True
        if marker != _START:
            position += int.from_bytes(jpeg[position : position + 2], "big")
    return False
