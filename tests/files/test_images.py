"""Images are read as they are in the file, or refused with the reason; never half."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from PIL import Image

from fringeworks.errors import FormatError, ShapeError, UsageError
from fringeworks.files import read_image, write_image
from fringeworks.files.image_header import inspect_image
from fringeworks.model.capture import MAX_PIXELS, Frames, to_grey
from tests.files.folders import pixels, write_raw

GREY8 = pixels("grey", shape=(11, 13))
GREY16 = pixels("deep", dtype=np.uint16, shape=(11, 13))
COLOUR8 = pixels("colour", shape=(11, 13, 3))
COLOUR16 = pixels("deep colour", dtype=np.uint16, shape=(11, 13, 3))


@pytest.mark.parametrize("suffix", [".png", ".tif", ".bmp", ".pgm"])
def test_grey_8_bit(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"grey{suffix}"
    write_raw(path, GREY8)
    header = inspect_image(path)
    assert (header.width, header.height, header.bits) == (13, 11, 8)
    assert not header.is_colour
    assert not header.lossy
    np.testing.assert_array_equal(read_image(path), GREY8)


@pytest.mark.parametrize("suffix", [".png", ".tif", ".pgm"])
def test_grey_16_bit(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"grey{suffix}"
    write_raw(path, GREY16)
    assert inspect_image(path).bits == 16
    np.testing.assert_array_equal(read_image(path), GREY16)


@pytest.mark.parametrize(
    ("suffix", "image"),
    [(suffix, COLOUR8) for suffix in (".png", ".tif", ".bmp", ".ppm")]
    + [(suffix, COLOUR16) for suffix in (".png", ".tif", ".ppm")],
)
def test_colour_is_rgb(tmp_path: Path, suffix: str, image: NDArray[Any]) -> None:
    path = tmp_path / f"colour{suffix}"
    write_raw(path, image[..., ::-1])
    header = inspect_image(path)
    assert header.is_colour
    assert header.bits == 8 * image.dtype.itemsize
    np.testing.assert_array_equal(read_image(path), image)


def test_12_bit_pgm_keeps_its_grey_levels(tmp_path: Path) -> None:
    levels = GREY16 % 4096
    path = tmp_path / "grey.pgm"
    path.write_bytes(b"P5\n13 11\n4095\n" + levels.astype(">u2").tobytes())
    assert inspect_image(path).bits == 16
    np.testing.assert_array_equal(read_image(path), levels)


@pytest.mark.parametrize("options", [{}, {"progressive": True}])
def test_jpeg_is_read_and_known_to_be_lossy(tmp_path: Path, options: dict[str, Any]) -> None:
    path = tmp_path / "grey.jpg"
    flat = np.full((16, 24), 77, dtype=np.uint8)
    Image.fromarray(flat).save(path, quality=95, **options)
    assert inspect_image(path).lossy
    np.testing.assert_array_equal(read_image(path), flat)


@pytest.mark.parametrize("suffix", [".jpg", ".png"])
def test_exif_orientation_does_not_turn_the_image(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"turned{suffix}"
    image = Image.fromarray(GREY8)
    exif = image.getexif()
    exif[274] = 6
    image.save(path, exif=exif)
    assert read_image(path).shape == GREY8.shape


def test_tiff_orientation_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "turned.tif"
    image = Image.fromarray(GREY8)
    exif = image.getexif()
    exif[274] = 6
    image.save(path, exif=exif)
    with pytest.raises(FormatError, match=r"turned\.tif: the TIFF orientation tag 6 would turn"):
        read_image(path)


def test_opaque_alpha_is_left_out(tmp_path: Path) -> None:
    write_raw(tmp_path / "a.png", np.dstack([COLOUR8, np.full((11, 13), 255, np.uint8)]))
    Image.fromarray(GREY8).convert("LA").save(tmp_path / "b.png")
    np.testing.assert_array_equal(read_image(tmp_path / "a.png"), COLOUR8[..., ::-1])
    np.testing.assert_array_equal(read_image(tmp_path / "b.png"), GREY8)


def test_transparency_in_use_is_refused(tmp_path: Path) -> None:
    write_raw(tmp_path / "a.png", np.dstack([COLOUR8, GREY8]))
    with pytest.raises(FormatError, match=r"a\.png: the image is partly transparent"):
        read_image(tmp_path / "a.png")


def test_palette_is_replaced_by_its_colours(tmp_path: Path) -> None:
    image = Image.fromarray(GREY8 // 64 * 64).convert("P")
    image.save(tmp_path / "palette.png")
    colour = read_image(tmp_path / "palette.png")
    np.testing.assert_array_equal(to_grey(colour), GREY8 // 64 * 64)


def test_one_bit_png_becomes_0_and_255(tmp_path: Path) -> None:
    bits = GREY8 > 127
    Image.fromarray(bits).save(tmp_path / "bits.png")
    np.testing.assert_array_equal(read_image(tmp_path / "bits.png"), bits * np.uint8(255))


def test_grey_of_colour_is_bt601_luma() -> None:
    rgb = np.array([[[100, 0, 0], [0, 100, 0], [0, 0, 100], [9, 9, 9]]], dtype=np.uint8)
    assert to_grey(rgb).tolist() == [[30, 59, 11, 9]]
    assert to_grey(GREY8) is GREY8


def test_unicode_path(tmp_path: Path) -> None:
    path = tmp_path / "Bäume" / "縞.png"
    write_image(path, GREY8)
    np.testing.assert_array_equal(read_image(path), GREY8)


@pytest.mark.parametrize(
    ("name", "data", "message"),
    [
        ("a.png", b"", "a.png: the file is empty; copy or record it again"),
        ("a.png", b"hello, world", "a.png: not an image; use PNG, TIFF, BMP, binary PGM or JPEG"),
        ("a.png", b"GIF89a" + bytes(60), "a.png: not an image"),
        ("a.png", b"\x89PNG\r\n", "a.png: the image is cut off or damaged in its header"),
        ("a.pgm", b"P5\n90000 90000\n255\n", f"at most {MAX_PIXELS} pixels"),
        ("a.pgm", b"P5\n10000 9000\n255\n", f"at most {MAX_PIXELS} pixels: 10000x9000"),
        ("a.pgm", b"P2\n2 1\n255\n1 2\n", "PGM must be binary"),
        ("a.pgm", b"P4\n8 1\n\x7f", "PGM must be binary"),
        ("a.pgm", b"P5\n13 11\n255\n" + bytes(142), "a.pgm: the PGM is cut off"),
    ],
)
def test_what_is_no_image_is_refused(tmp_path: Path, name: str, data: bytes, message: str) -> None:
    (tmp_path / name).write_bytes(data)
    with pytest.raises(FormatError) as caught:
        read_image(tmp_path / name)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("image", "message"),
    [
        (GREY8.astype(np.float32), "8 or 16 bit per channel, got floating or signed numbers"),
        (GREY8.astype(np.int32), "8 or 16 bit per channel, got floating or signed numbers"),
        (GREY8 > 9, "8 or 16 bit per channel, got 1 bit"),
    ],
)
def test_tiff_of_other_depths(tmp_path: Path, image: NDArray[Any], message: str) -> None:
    Image.fromarray(image).save(tmp_path / "a.tif")
    with pytest.raises(FormatError, match=message):
        inspect_image(tmp_path / "a.tif")


def test_tiff_of_several_pages(tmp_path: Path) -> None:
    page = Image.fromarray(GREY8)
    page.save(tmp_path / "a.tif", save_all=True, append_images=[page, page])
    with pytest.raises(FormatError, match="one image per file is read, got a TIFF of 3 pages"):
        inspect_image(tmp_path / "a.tif")


def test_cmyk_and_few_bit_bmp(tmp_path: Path) -> None:
    Image.fromarray(COLOUR8).convert("CMYK").save(tmp_path / "a.jpg")
    with pytest.raises(FormatError, match=r"a\.jpg: grey or RGB is read, got CMYK"):
        inspect_image(tmp_path / "a.jpg")
    Image.fromarray(GREY8 > 9).save(tmp_path / "a.bmp")
    with pytest.raises(FormatError, match="got 4 bit"):
        inspect_image(tmp_path / "a.bmp")


def test_missing_file_and_folder(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="not a regular file; is it a folder or a device"):
        inspect_image(tmp_path)
    with pytest.raises(FormatError, match="no such file"):
        inspect_image(tmp_path / "none.png")
    with pytest.raises(FormatError, match="cannot be read"):
        inspect_image(tmp_path / ("n" * 300))


def test_a_flipped_bit_in_a_png_is_found(tmp_path: Path) -> None:
    write_image(tmp_path / "a.png", GREY8)
    data = bytearray((tmp_path / "a.png").read_bytes())
    data[len(data) // 2] ^= 4
    (tmp_path / "a.png").write_bytes(data)
    with pytest.raises(FormatError, match=r"a\.png: the image is cut off or damaged"):
        inspect_image(tmp_path / "a.png")


def _encoded(suffix: str, image: NDArray[Any], *options: int) -> bytes:
    done, data = cv2.imencode(suffix, image, options)
    assert done
    return data.tobytes()


def _pillow(kind: str, **options: Any) -> bytes:
    file = io.BytesIO()
    Image.fromarray(GREY8).save(file, kind, **options)
    return file.getvalue()


FILES = {
    "8.png": _encoded(".png", GREY8),
    "16.png": _encoded(".png", GREY16),
    "colour.png": _encoded(".png", COLOUR8),
    "lzw.tif": _encoded(".tif", GREY16),
    "plain.tif": _encoded(".tif", GREY8, cv2.IMWRITE_TIFF_COMPRESSION, 1),
    "pillow.tif": _pillow("TIFF"),
    "8.bmp": _encoded(".bmp", GREY8),
    "colour.bmp": _encoded(".bmp", COLOUR8),
    "8.pgm": _encoded(".pgm", GREY8),
    "16.pgm": _encoded(".pgm", GREY16),
    "8.jpg": _encoded(".jpg", GREY8),
    "colour.jpg": _encoded(".jpg", COLOUR8),
    "progressive.jpg": _pillow("JPEG", progressive=True),
}


def read_or_refuse(path: Path) -> Frames | None:
    """The image, or None where a FormatError names the file; nothing else comes out."""
    try:
        return read_image(path)
    except FormatError as error:
        refused = str(error)
    assert str(path) in refused
    return None


@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@pytest.mark.parametrize("name", FILES)
@given(data=st.data())
def test_cut_off_anywhere_it_is_refused(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], name: str, data: st.DataObject
) -> None:
    """By its header alone, and without a word of the decoder on the terminal."""
    path = tmp_path / name
    path.write_bytes(FILES[name])
    assert inspect_image(path).width == 13
    path.write_bytes(FILES[name][: data.draw(st.integers(0, len(FILES[name]) - 1))])
    with pytest.raises(FormatError, match=name):
        inspect_image(path)
    with pytest.raises(FormatError, match=name):
        read_image(path)
    assert capfd.readouterr().err == ""


@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@pytest.mark.parametrize("name", FILES)
@given(data=st.data())
def test_damaged_anywhere_it_is_read_or_refused(
    tmp_path: Path, name: str, data: st.DataObject
) -> None:
    spoilt = bytearray(FILES[name])
    for _ in range(data.draw(st.integers(1, 3))):
        spoilt[data.draw(st.integers(0, min(len(spoilt), 600) - 1))] = data.draw(
            st.integers(0, 255)
        )
    path = tmp_path / name
    path.write_bytes(spoilt)
    image = read_or_refuse(path)
    if image is not None:
        assert image.dtype in (np.uint8, np.uint16)
        assert image.size > 0


@pytest.mark.parametrize("image", [GREY8, GREY16, COLOUR8, COLOUR16])
def test_written_images_read_back(tmp_path: Path, image: NDArray[Any]) -> None:
    write_image(tmp_path / "a.png", image)
    np.testing.assert_array_equal(read_image(tmp_path / "a.png"), image)


def test_what_cannot_be_written(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"written as \.png, got 'a\.tif'"):
        write_image(tmp_path / "a.tif", GREY8)
    with pytest.raises(ShapeError, match="must be uint8 or uint16, got float64"):
        write_image(tmp_path / "a.png", GREY8.astype(float))
    with pytest.raises(ShapeError, match=r"must be \(H, W\) or \(H, W, 3\), got \(11, 13, 2\)"):
        write_image(tmp_path / "a.png", COLOUR8[..., :2])
    assert list(tmp_path.iterdir()) == []
