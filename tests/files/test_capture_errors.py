"""Whatever is wrong with a capture is said with file, set and key."""

from __future__ import annotations

import os
import re
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fringeworks.errors import FormatError
from fringeworks.files import capture_images, read_capture
from fringeworks.files.validation import read_text
from tests.files.folders import (
    HEIGHT,
    WIDTH,
    Document,
    document,
    make_capture,
    pixels,
    write_raw,
    write_toml,
)


def refusal(folder: Path) -> str:
    """The message, with the folder's own path cut out."""
    with pytest.raises(FormatError) as caught:
        read_capture(folder)
    text = str(caught.value)
    assert str(folder) in text
    return text.replace(f"{folder}{os.sep}", "").replace(str(folder), "FOLDER")


def in_set(index: int, **changes: Any) -> Callable[[Document], None]:
    """Change keys of a set; a value of None takes the key away."""

    def edit(description: Document) -> None:
        for key, value in changes.items():
            if value is None:
                del description["set"][index][key]
            else:
                description["set"][index][key] = value

    return edit


def at_top(**changes: Any) -> Callable[[Document], None]:
    return lambda description: description.update(changes)


def as_set(index: int, **keys: Any) -> Callable[[Document], None]:
    """Another set in its place, with as many images as it has shifts."""

    def edit(description: Document) -> None:
        images = [f"f{i}.png" for i in range(len(keys.get("shifts_deg", [0.0])))]
        description["set"][index] = {**keys, "images": images}

    return edit


def gray_again(description: Document) -> None:
    again = {**description["set"][GRAY], "images": ["h0.png", "h1.png"]}
    description["set"].append(again)


def wider(extent: int, edit: Callable[[Document], None]) -> Callable[[Document], None]:
    def both(description: Document) -> None:
        description["projector"]["width"] = extent
        description["set"][GRAY]["cell_px"] = 16.0
        edit(description)

    return both


FRINGE, GRAY, CODE, WHITE = range(4)
THIRDS = [0.0, 120.0, 240.0]

DESCRIPTIONS: list[tuple[Callable[[Document], None], str]] = [
    (
        in_set(FRINGE, perod_px=8.0),
        "capture.toml: set 1 (fringe): unknown key 'perod_px', "
        "did you mean 'period_px' or 'zero_px'?",
    ),
    (
        in_set(WHITE, qqq=1),
        "capture.toml: set 4 (uniform): unknown key 'qqq'; known here: images, group, "
        "exposure_ms, repeats, timestamps_s, kind, level",
    ),
    (at_top(pojector=1), "capture.toml: unknown key 'pojector', did you mean 'projector'?"),
    (
        at_top(camera={"fullscale": 255}),
        "capture.toml: unknown key 'camera.fullscale', did you mean 'full_scale'?",
    ),
    (
        in_set(CODE, kind="code"),
        "capture.toml: set 3: kind must be one of fringe, gray, uniform, codeword, checkerboard, "
        "staircase, colour, speckle, image, got 'code', did you mean 'codeword'?",
    ),
    (in_set(CODE, kind=None), "capture.toml: set 3: kind is missing"),
    (in_set(GRAY, axis="z"), "capture.toml: set 2 (gray): axis must be 'x' or 'y', got 'z'"),
    (in_set(GRAY, axis=None), "capture.toml: set 2 (gray): axis is missing"),
    (in_set(FRINGE, period_px=-3), "set 1 (fringe): period_px must be >= 2, got -3"),
    (in_set(FRINGE, period_px="8"), "set 1 (fringe): period_px must be a number, got '8'"),
    (
        in_set(FRINGE, period_px=float("nan")),
        "set 1 (fringe): period_px must be a finite number, got nan",
    ),
    (
        in_set(FRINGE, zero_px=float("inf")),
        "set 1 (fringe): zero_px must be a finite number, got inf",
    ),
    (in_set(GRAY, cell_px=0.0), "set 2 (gray): cell_px must be >= 1, got 0.0"),
    (in_set(WHITE, level=1.5), "set 4 (uniform): level must be <= 1, got 1.5"),
    (in_set(WHITE, level=-0.1), "set 4 (uniform): level must be >= 0, got -0.1"),
    (in_set(WHITE, repeats=0), "set 4 (uniform): repeats must be >= 1, got 0"),
    (in_set(WHITE, repeats=1.0), "set 4 (uniform): repeats must be a whole number, got 1.0"),
    (in_set(WHITE, exposure_ms=0.0), "set 4 (uniform): exposure_ms must be > 0, got 0.0"),
    (in_set(WHITE, group=""), "set 4 (uniform): group must not be empty"),
    (in_set(WHITE, images=[]), "set 4 (uniform): images must not be empty"),
    (in_set(WHITE, images="white.png"), "set 4 (uniform): images must be a list"),
    (in_set(WHITE, images=[3]), "set 4 (uniform): images[0] must be text, got 3"),
    (at_top(set=[]), "capture.toml: set must not be empty"),
    (at_top(set=[1]), "capture.toml: set 1: it must be a table, got 1"),
    (at_top(projector={"width": 32}), "capture.toml: projector.height is missing"),
    (
        at_top(projector={"width": 10**9, "height": 1}),
        "capture.toml: projector.width must be <= 65536, got 1000000000",
    ),
    (at_top(projector=5), "capture.toml: projector must be a table, got 5"),
    (
        in_set(GRAY, complementary=3),
        "capture.toml: set 2 (gray): complementary: must be an image name or a list of them, got 3",
    ),
    (at_top(camera={"gain": 65536.0}), "capture.toml: camera.gain must be <= 65535, got 65536.0"),
    (at_top(camera={"read_noise": 1e6}), "camera.read_noise must be <= 65535, got 1000000.0"),
    (
        in_set(GRAY, images=["g0.png", "./g0.png"]),
        "set 2 (gray): image 'g0.png' is used 2 times",
    ),
    (
        in_set(GRAY, images=["g0.png", "./f1.png"]),
        "set 2 (gray): image 'f1.png' is in set 1 (fringe) as well, which shows another pattern",
    ),
    (
        in_set(CODE, images=["g1.png"]),
        "set 3 (codeword): image 'g1.png' is in set 2 (gray) as well",
    ),
    (
        gray_again,
        "set 5 (gray): Gray codes with axis 'x', cell_px = 8 stand twice in one group, here and "
        "in set 2 (gray)",
    ),
    (at_top(camera={"gain": -0.1}), "capture.toml: camera.gain must be >= 0, got -0.1"),
    (
        at_top(camera={"full_scale": 4095}),
        "capture.toml: camera.full_scale must be at most 255 for uint8 images, got 4095",
    ),
    (
        at_top(format="fringeworks-capture/2"),
        "format must be 'fringeworks-capture/1', got 'fringeworks-capture/2'",
    ),
    (
        in_set(FRINGE, images=["f0.png", "f1.png"]),
        "set 1 (fringe): images must be 3 (3 shifts), got 2",
    ),
    (
        in_set(FRINGE, repeats=2),
        "set 1 (fringe): images must be 6 (3 shifts x 2 repeats), got 3",
    ),
    (
        in_set(WHITE, images=["white.png", "b.png"]),
        "set 4 (uniform): images must be 1 (1 frame), got 2",
    ),
    (
        in_set(CODE, images=["code.png", "b.png"], repeats=3),
        "set 3 (codeword): images must be 3 (1 frame x 3 repeats), got 2",
    ),
    (
        in_set(FRINGE, shifts_deg=[0.0, 180.0], images=["f0.png", "f1.png"]),
        "set 1 (fringe): shifts must be three at least that differ clearly modulo 360 degrees, "
        "got 2: 0, 180",
    ),
    (
        in_set(FRINGE, shifts_deg=[0.0, 120.0, 480.0]),
        "set 1 (fringe): shifts must be three at least that differ clearly modulo 360 degrees, "
        "got 3: 0, 120, 480",
    ),
    (
        in_set(FRINGE, shifts_deg=[0.0, 0.001, 0.002]),
        "set 1 (fringe): shifts must be three at least that differ clearly modulo 360 degrees",
    ),
    (
        in_set(GRAY, images=["g0.png"]),
        "set 2 (gray): bits must be 2 to 16 for 32 px in cells of 8 px, got 1; "
        "are images missing, or is projector size or cell_px wrong?",
    ),
    (
        in_set(GRAY, inverted=["h0.png"]),
        "set 2 (gray): inverted must be as many as images, 2, got 1",
    ),
    (
        in_set(GRAY, complementary=["h0.png", "h1.png"]),
        "set 2 (gray): complementary must be 1 (one per repeat), got 2",
    ),
    (
        in_set(GRAY, images=["g0.png", "g1.png", "g2.png"], repeats=2),
        "set 2 (gray): images must be a multiple of repeats = 2, got 3",
    ),
    (
        in_set(GRAY, images=["g0.png", "g0.png"]),
        "set 2 (gray): image 'g0.png' is used 2 times",
    ),
    (
        in_set(GRAY, inverted=["g1.png", "g0.png"]),
        "set 2 (gray): image 'g0.png' is used 2 times",
    ),
    (
        in_set(GRAY, cell_px=8.5),
        "set 2 (gray): cell_px must be a width whose edges (every 8.5 px from the image's edge) "
        "meet no pixel centre, as a whole number is, got 8.5",
    ),
    (
        in_set(GRAY, cell_px=9.0, complementary="half.png"),
        "set 2 (gray): cell_px must be a width whose edges (every 4.5 px from the image's edge) "
        "meet no pixel centre, as an even whole number is, got 9",
    ),
    (
        in_set(WHITE, timestamps_s=[0.0, 1.0]),
        "set 4 (uniform): timestamps_s must be one per image, 1, got 2",
    ),
    (
        in_set(CODE, period_px=16.0),
        "set 3 (codeword): the code frame is read along the wrapped phase of fringes with "
        "axis 'x', period_px = 16, zero_px = -0.5: no such set",
    ),
    (in_set(CODE, axis="y"), "fringes with axis 'y', period_px = 8, zero_px = -0.5: no such set"),
    (in_set(CODE, zero_px=1.5), "fringes with axis 'x', period_px = 8, zero_px = 1.5: no such set"),
    (
        in_set(CODE, period_px=7.0),
        "set 3 (codeword): period_px must be an even whole number of px under a code frame, got 7",
    ),
    (in_set(CODE, zero_px=0.0), "zero_px must be on an edge between pixels, got 0"),
    (
        in_set(CODE, sequence=[0, 1, 2, 1, 0]),
        "set 3 (codeword): sequence must be of indices 0 to 1, got 2",
    ),
    (
        in_set(CODE, sequence=[0, 1, 0, 1]),
        "set 3 (codeword): sequence must be long enough for orders 0 to 4, got 4 entries",
    ),
    (
        in_set(CODE, sequence=[0, 1, 0, 1, 0], zero_px=15.5),
        "set 3 (codeword): sequence must be long enough for orders -2 to 2",
    ),
    (  # 36 px are 4.5 fringes of 8 px: C19 counts order 5
        wider(36, in_set(CODE, sequence=[0, 1, 0, 1, 0])),
        "set 3 (codeword): sequence must be long enough for orders 0 to 5, got 5 entries",
    ),
    (in_set(CODE, codewords_px=[4.0, 4.0]), "codewords_px must be different periods from 2 px"),
    (
        as_set(WHITE, kind="staircase", axis="x", period_px=8.0, levels=4, shifts_deg=THIRDS),
        "set 4 (staircase): levels must be at least 5, one per fringe order 0 to 4, got 4",
    ),
    (
        as_set(WHITE, kind="colour", axis="x", period_px=9.0, palette=["red"]),
        "set 4 (colour): period_px must be a width whose edges (every 4.5 px",
    ),
    (
        as_set(WHITE, kind="colour", axis="x", period_px=8.0, palette=["mauve"]),
        "set 4 (colour): palette must be of black, red",
    ),
]


@pytest.mark.parametrize(
    ("edit", "message"), DESCRIPTIONS, ids=[message[-50:] for _, message in DESCRIPTIONS]
)
def test_descriptions(tmp_path: Path, edit: Callable[[Document], None], message: str) -> None:
    description = document()
    edit(description)
    make_capture(tmp_path)
    for name in ("b.png", "g2.png", "h0.png", "h1.png", "half.png"):
        write_raw(tmp_path / name, pixels(name))
    write_toml(tmp_path, description)
    assert message in refusal(tmp_path)


def test_sequence_of_the_right_length_is_fine(tmp_path: Path) -> None:
    description = document()
    description["set"][CODE]["sequence"] = [0, 1, 0, 1, 0]
    assert len(read_capture(make_capture(tmp_path, description)).frames) == 4


def test_a_code_frame_needs_its_fringes_in_every_group(tmp_path: Path) -> None:
    description = document()
    description["set"][FRINGE]["group"] = "short"
    description["set"][WHITE]["group"] = "long"
    assert "no such set in group 'long'" in refusal(make_capture(tmp_path, description))


def test_all_problems_are_told_at_once(tmp_path: Path) -> None:
    description = document()
    for item in description["set"]:
        item["colour_of_the_wall"] = "red"
    description["camera"] = {"gain": -1.0, "read_noise": -1.0, "lens": "blue"}
    lines = refusal(make_capture(tmp_path, description)).splitlines()
    assert len(lines) == 6
    assert all(line.startswith("capture.toml: ") for line in lines[:5])
    assert lines[5] == "... and 2 more"


def test_the_format_key_is_missing(tmp_path: Path) -> None:
    description = document()
    del description["format"]
    text = refusal(make_capture(tmp_path, description))
    assert "format must be 'fringeworks-capture/1', the key is missing" in text


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"format = ", r"capture.toml: not valid TOML: Invalid value \(at end of document\)"),
        (b"format = 'x'\n[projector\n", r"not valid TOML: .* \(at line 2, column 11\)"),
        (b"a = 1\na = 2\n", r"not valid TOML: .*\(at line 2"),
        (b"a = " + b"[" * 20000, "not valid TOML: too deeply nested"),
        (b"a = " + b"1" * 5000, "not valid TOML"),
        (b"a = '\xff'", r"capture.toml: not UTF-8 text \(byte 5\)"),
        (b"", "format must be 'fringeworks-capture/1', the key is missing"),
    ],
)
def test_what_is_no_toml(tmp_path: Path, text: bytes, message: str) -> None:
    (tmp_path / "capture.toml").write_bytes(text)
    assert re.search(message, refusal(tmp_path))


def test_a_huge_description_is_not_read(tmp_path: Path) -> None:
    with (tmp_path / "capture.toml").open("wb") as file:
        file.truncate(2**25)
    assert "larger than 16777216 bytes" in refusal(tmp_path)


def test_a_device_is_not_read() -> None:
    if not Path("/dev/zero").exists():
        pytest.skip("this system has no /dev/zero")
    with pytest.raises(FormatError, match="/dev/zero: not a regular file"):
        read_text(Path("/dev/zero"))


@pytest.mark.parametrize(
    "key", ["a" + ".a" * 100, '"="' + '."="' * 100, "x = { a" + " . a" * 100, "[a" + ".a" * 100]
)
def test_a_key_of_many_parts_is_refused(tmp_path: Path, key: str) -> None:
    (tmp_path / "capture.toml").write_text(f"{key} = 1\n")
    assert "keys must have at most 100 parts between dots, got" in refusal(tmp_path)


def test_dots_elsewhere_are_no_key(tmp_path: Path) -> None:
    description = document()
    description["provenance"] = {"text": "a." * 200, "files": [f"f{i}.png" for i in range(200)]}
    toml = make_capture(tmp_path, description) / "capture.toml"
    toml.write_text("# " + "." * 200 + "\n" + toml.read_text())
    assert len(read_capture(tmp_path).frames) == 4


def test_a_misspelt_format(tmp_path: Path) -> None:
    description = document()
    description["fromat"] = description.pop("format")
    text = refusal(make_capture(tmp_path, description))
    assert text == "capture.toml: unknown key 'fromat', did you mean 'format'?"


def test_a_folder_without_description(tmp_path: Path) -> None:
    text = refusal(tmp_path)
    assert "no capture.toml in this folder; it says what each image shows" in text
    assert "docs/formats.md" in text
    assert "`fringeworks patterns`" in text


def test_no_such_folder(tmp_path: Path) -> None:
    assert refusal(tmp_path / "none").endswith("no such file or folder")


def test_missing_images_are_counted_and_named(tmp_path: Path) -> None:
    folder = make_capture(tmp_path)
    for path in folder.glob("*.png"):
        path.unlink()
    assert "7 of 7 images are missing: f0.png, f1.png, f2.png, g0.png, g1.png, ...;" in refusal(
        folder
    )
    make_capture(tmp_path)
    (folder / "g1.png").unlink()
    assert "1 of 7 images are missing: g1.png; record them" in refusal(folder)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("../white.png", "image path '../white.png' leaves the capture's folder"),
        ("a/../../white.png", "leaves the capture's folder"),
        ("/etc/hostname", "leaves the capture's folder"),
        ("C:/white.png", "leaves the capture's folder"),
        ("C:white.png", "leaves the capture's folder"),
        ("a\\white.png", "must be a name, with / between folders"),
        ("", "image path '' must be a name"),
        ("a\0b", "must be a name"),
        ("x" * 5000, "1 of 7 images are missing"),
        (".", "1 of 7 images are missing: ."),
    ],
)
def test_paths_that_leave_the_folder(tmp_path: Path, name: str, message: str) -> None:
    folder = make_capture(tmp_path / "inside")
    write_raw(tmp_path / "white.png", pixels("white.png"))
    description = document()
    description["set"][WHITE]["images"] = [name]
    write_toml(folder, description)
    assert message in refusal(folder)


def _link(path: Path, target: Path) -> None:
    try:
        path.symlink_to(target)
    except OSError:
        pytest.skip("this system makes no symbolic links for us")


def test_a_link_that_leaves_the_folder(tmp_path: Path) -> None:
    folder = make_capture(tmp_path / "inside")
    (folder / "white.png").rename(tmp_path / "white.png")
    _link(folder / "white.png", tmp_path / "white.png")
    assert "image path 'white.png' leaves the capture's folder" in refusal(folder)


def test_a_loop_of_links(tmp_path: Path) -> None:
    folder = make_capture(tmp_path / "inside")
    (folder / "white.png").unlink()
    _link(folder / "white.png", folder / "white.png")
    assert re.search("cannot be followed|missing", refusal(folder))


def test_links_within_and_to_the_folder_are_fine(tmp_path: Path) -> None:
    folder = make_capture(tmp_path / "inside")
    (folder / "white.png").rename(folder / "other.png")
    _link(folder / "white.png", folder / "other.png")
    _link(tmp_path / "alias", folder)
    assert len(read_capture(tmp_path / "alias").frames) == 4


def test_sizes_that_differ(tmp_path: Path) -> None:
    folder = make_capture(tmp_path)
    write_raw(folder / "g1.png", pixels("g1.png", shape=(HEIGHT, WIDTH + 1)))
    assert refusal(folder) == (
        "g1.png: 8x5, but f0.png is 7x5; all images of a capture have one camera's size"
    )


def test_depths_that_differ_even_in_another_group(tmp_path: Path) -> None:
    description = document()
    description["set"].append(
        {"kind": "uniform", "level": 0.0, "group": "b", "images": ["black.png"]}
    )
    description["set"].insert(
        0, {"kind": "uniform", "level": 0.0, "group": "a", "images": ["dark.png"]}
    )
    folder = make_capture(tmp_path, description)
    write_raw(folder / "black.png", pixels("black.png", dtype=np.uint16))
    assert refusal(folder) == (
        "black.png: 16 bit, but dark.png is 8 bit; record all images of a capture with one depth"
    )


def test_a_truncated_image_is_found_before_any_is_decoded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = make_capture(tmp_path)
    data = (folder / "white.png").read_bytes()
    (folder / "white.png").write_bytes(data[: len(data) // 2])
    monkeypatch.setattr(capture_images, "decode_image", None)
    assert "white.png: the image is cut off or damaged" in refusal(folder)


def _chunk(kind: bytes, data: bytes) -> bytes:
    check = zlib.crc32(kind + data)
    return len(data).to_bytes(4, "big") + kind + data + check.to_bytes(4, "big")


def test_damage_that_only_the_decoder_sees(tmp_path: Path) -> None:
    """All checksums right, and not enough rows in the compressed data."""
    header = WIDTH.to_bytes(4, "big") + HEIGHT.to_bytes(4, "big") + bytes([8, 0, 0, 0, 0])
    rows = zlib.compress(bytes(2 * (WIDTH + 1)))
    chunks = _chunk(b"IHDR", header) + _chunk(b"IDAT", rows) + _chunk(b"IEND", b"")
    folder = make_capture(tmp_path)
    (folder / "white.png").write_bytes(b"\x89PNG\r\n\x1a\n" + chunks)
    assert "white.png: the image data are damaged; copy or record it again" in refusal(folder)


def test_too_many_pixels_for_the_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(capture_images, "MAX_CAPTURE_BYTES", 7 * WIDTH * HEIGHT - 1)
    assert "7 images need 0.0 GiB, at most" in refusal(make_capture(tmp_path))


def test_an_absurd_size_is_refused_before_it_is_allocated(tmp_path: Path) -> None:
    description = document()
    description["set"][WHITE]["images"] = ["white.pgm"]
    make_capture(tmp_path, description)
    (tmp_path / "white.pgm").write_bytes(b"P5\n4000000 4000000\n255\n")
    assert "white.pgm: an image must have at most 89478485 pixels" in refusal(tmp_path)
