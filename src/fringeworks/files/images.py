"""Read and write single images, 8 or 16 bit, without any change of grey level or orientation."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import cast

import numpy as np

from fringeworks.errors import FormatError, ShapeError, UsageError
from fringeworks.files.atomic import replacing
from fringeworks.files.image_header import ImageHeader, inspect_image
from fringeworks.model.capture import Frames


@contextmanager
def quiet_opencv() -> Iterator[None]:
    """Keep OpenCV's own log off the terminal: what it would say is in our message."""
    import cv2

    log = cv2.utils.logging
    before = log.getLogLevel()
    log.setLogLevel(log.LOG_LEVEL_SILENT)
    try:
        yield
    finally:
        log.setLogLevel(before)


def read_image(path: str | Path) -> Frames:
    """Pixels of an image file: ``(H, W)`` grey or ``(H, W, 3)`` RGB, uint8 or uint16.

    Grey levels are those of the file; an EXIF orientation does not turn it; an opaque alpha
    channel is left out and a palette replaced by its colours.

    Raises
    ------
    FormatError
        As `inspect_image`; or the pixel data are damaged, or an alpha channel is in use.
    """
    path = Path(path)
    return decode_image(path, inspect_image(path))


def decode_image(path: Path, header: ImageHeader) -> Frames:
    """As `read_image`, for a file that was inspected before; may be called in several threads."""
    # From bytes: OpenCV's own file access cannot open every Unicode path on Windows.
    data = np.fromfile(path, dtype=np.uint8)
    image = _decode(path, data)
    expected = (header.height, header.width)
    if image.shape[:2] != expected or image.dtype.itemsize * 8 != header.bits:
        raise FormatError(
            f"{path}: the header says {_size(header)}, {header.bits} bit, but the data decode to "
            f"{image.shape[1]}x{image.shape[0]}, {image.dtype}; copy or record it again"
        )
    return _without_alpha(path, image, header)


def _decode(path: Path, data: np.ndarray[tuple[int], np.dtype[np.uint8]]) -> Frames:
    import cv2

    with quiet_opencv():
        try:
            # UNCHANGED keeps depth and channels, and leaves EXIF orientation alone.
            image = cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
        except cv2.error:
            image = None
    if image is None:
        raise FormatError(f"{path}: the image data are damaged; copy or record it again")
    return cast(Frames, image)


def _size(header: ImageHeader) -> str:
    return f"{header.width}x{header.height}"


def _without_alpha(path: Path, image: Frames, header: ImageHeader) -> Frames:
    if image.ndim == 2:
        return image
    if image.shape[2] == 4 and header.channels in (2, 4):
        opaque = np.iinfo(image.dtype).max
        if not np.all(image[..., 3] == opaque):
            raise FormatError(f"{path}: the image is partly transparent; save it without alpha")
    if header.channels <= 2:
        return cast(Frames, np.ascontiguousarray(image[..., 0]))
    return cast(Frames, np.ascontiguousarray(image[..., 2::-1]))


def write_image(path: str | Path, image: Frames) -> None:
    """Write ``(H, W)`` grey or ``(H, W, 3)`` RGB, uint8 or uint16, as PNG; atomic.

    Raises
    ------
    UsageError
        The suffix is not ``.png``.
    ShapeError
        Another shape or type of array.
    FormatError
        The file cannot be written.
    """
    import cv2

    path = Path(path)
    if path.suffix.lower() != ".png":
        raise UsageError(f"images are written as .png, got '{path.name}'")
    if image.dtype not in (np.uint8, np.uint16):
        raise ShapeError(f"image must be uint8 or uint16, got {image.dtype}")
    if image.size == 0 or not (image.ndim == 2 or (image.ndim == 3 and image.shape[2] == 3)):
        raise ShapeError(f"image must be (H, W) or (H, W, 3), got {image.shape}")
    pixels = image if image.ndim == 2 else image[..., ::-1]
    done, data = cv2.imencode(".png", np.ascontiguousarray(pixels))
    if not done:
        raise FormatError(f"{path}: OpenCV cannot encode an image of {image.shape}")
    with replacing(path) as temporary:
        # Not `tofile`, which does not tell of a disk that is full when it puts down its last bytes.
        temporary.write_bytes(data.tobytes())
