"""Captures that are fine, or fine with something to say."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pytest

from fringeworks.errors import UsageError
from fringeworks.files import read_capture
from fringeworks.model import (
    Capture,
    Checkerboard,
    Codeword,
    Colour,
    Fringe,
    GrayCode,
    Picture,
    Sensor,
    Speckle,
    Staircase,
    Uniform,
)
from fringeworks.model.capture import to_grey
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

Item = TypeVar("Item")


def test_sequence_and_frames(tmp_path: Path) -> None:
    capture = read_capture(make_capture(tmp_path / "mug"))
    third = 2 * math.pi / 3
    assert [item.pattern for item in capture.sequence.sets] == [
        Fringe("x", 8.0, (pytest.approx(third), 0.0, pytest.approx(-third))),  # type: ignore[arg-type]
        GrayCode("x", 2, 8.0),
        Codeword("x", 8.0, (2.0, 4.0)),
        Uniform(1.0),
    ]
    assert (capture.sequence.width, capture.sequence.height) == (32, 24)
    assert capture.name == "mug"
    assert capture.sensor == Sensor(255.0)
    assert capture.findings == ()
    assert capture.colour is None
    names = [["f0.png", "f1.png", "f2.png"], ["g0.png", "g1.png"], ["code.png"], ["white.png"]]
    for stack, row in zip(capture.frames, names, strict=True):
        np.testing.assert_array_equal(stack, [pixels(name) for name in row])


def test_the_description_itself_may_be_named(tmp_path: Path) -> None:
    folder = make_capture(tmp_path / "mug")
    (folder / "capture.toml").rename(folder / "second.toml")
    assert read_capture(str(folder / "second.toml")).name == "mug"


def test_a_byte_order_mark_is_ignored(tmp_path: Path) -> None:
    folder = make_capture(tmp_path)
    toml = folder / "capture.toml"
    toml.write_bytes(b"\xef\xbb\xbf" + toml.read_bytes())
    assert len(read_capture(folder).frames) == 4


def test_every_kind(tmp_path: Path) -> None:
    description = document()
    description["set"] = [
        {"kind": "checkerboard", "square_px": 16.0, "images": ["a.png"]},
        {
            "kind": "staircase",
            "axis": "y",
            "period_px": 8.0,
            "levels": 4,
            "shifts_deg": [0.0, 90.0, 180.0],
            "images": ["s0.png", "s1.png", "s2.png"],
        },
        {
            "kind": "colour",
            "axis": "x",
            "period_px": 8.0,
            "palette": ["red", "green"],
            "images": ["c.png"],
        },
        {"kind": "speckle", "seed": 7, "dot_px": 2.5, "images": ["d.png"]},
        {"kind": "image", "images": ["i.png", "j.png"]},
    ]
    capture = read_capture(make_capture(tmp_path, description))
    assert [item.pattern for item in capture.sequence.sets] == [
        Checkerboard(16.0),
        Staircase("y", 8.0, 4, (0.0, math.pi / 2, math.pi)),
        Colour("x", 8.0, ("red", "green")),
        Speckle(7, 2.5),
        Picture(2),
    ]
    assert [str(finding) for finding in capture.findings] == [
        "warning: set 3 (colour): its images are grey. Record them with a colour camera."
    ]


def test_gray_frames_stand_in_the_order_of_the_model(tmp_path: Path) -> None:
    description = document()
    gray = description["set"][1]
    gray.update(inverted=["h0.png", "h1.png"], complementary="half.png")
    capture = read_capture(make_capture(tmp_path, description))
    pattern = capture.sequence.sets[1].pattern
    assert pattern == GrayCode("x", 2, 8.0, inverted=True, complementary=True)
    order = ["g0.png", "g1.png", "half.png", "h0.png", "h1.png"]
    np.testing.assert_array_equal(capture.frames[1], [pixels(name) for name in order])


def test_repeats_stand_shift_by_shift(tmp_path: Path) -> None:
    description = document()
    description["set"][0].update(
        repeats=2,
        images=[f"f{shift}{repeat}.png" for shift in range(3) for repeat in "ab"],
        exposure_ms=12.5,
        timestamps_s=[0.1 * i for i in range(6)],
    )
    item, stack = next(iter(read_capture(make_capture(tmp_path, description))))
    assert (item.repeats, item.exposure_ms, item.image_count) == (2, 12.5, 6)
    assert item.timestamps_s == tuple(0.1 * i for i in range(6))
    np.testing.assert_array_equal(stack[3], pixels("f1b.png"))


def _grouped() -> Document:
    description = document()
    description["set"][0]["group"] = "short"
    description["set"][2]["group"] = "short"
    description["set"].append(
        {**description["set"][0], "group": "long", "images": ["l0.png", "l1.png", "l2.png"]}
    )
    return description


def test_the_first_group_or_the_one_asked_for(tmp_path: Path) -> None:
    folder = make_capture(tmp_path, _grouped())
    assert [len(stack) for stack in read_capture(folder).frames] == [3, 2, 1, 1]
    other = read_capture(folder, group="long")
    assert [item.group for item in other.sequence.sets] == [None, None, "long"]
    np.testing.assert_array_equal(other.frames[2][0], pixels("l0.png"))


def test_a_group_that_is_not_there(tmp_path: Path) -> None:
    folder = make_capture(tmp_path, _grouped())
    with pytest.raises(UsageError, match=r"must be one of the capture's \(short, long\), got 'x'"):
        read_capture(folder, group="x")


def test_camera_and_provenance_are_kept(tmp_path: Path) -> None:
    description = document()
    camera = {"full_scale": 250, "black_level": 3.0, "gain": 0.02, "read_noise": 0.8}
    description["camera"] = {**camera, "temperature_c": 31.5}
    description["provenance"] = {"note": "a bench", "serials": [1, 2], "lamp": {"hours": 3}}
    capture = read_capture(make_capture(tmp_path, description))
    assert capture.sensor == Sensor(250.0, 3.0, 0.02, 0.8, 31.5)
    assert capture.provenance == description["provenance"]


@pytest.mark.parametrize(
    ("brightest", "assumed"),
    [(900, 1023), (1023, 1023), (1024, 4095), (4096, 16383), (16384, 65535), (65535, 65535)],
)
def test_full_scale_of_16_bit_is_assumed_and_said(
    tmp_path: Path, brightest: int, assumed: int
) -> None:
    folder = make_capture(tmp_path, dtype=np.uint16)
    for path in folder.glob("*.png"):
        write_raw(path, np.full((HEIGHT, WIDTH), brightest, dtype=np.uint16))
    capture = read_capture(folder)
    assert capture.sensor.full_scale == assumed
    assert capture.frames[0].dtype == np.uint16
    assert [str(finding) for finding in capture.findings] == [
        f"note: full_scale is not given: {assumed} assumed, as grey levels reach {brightest}. "
        "Set full_scale in [camera]."
    ]


def test_grey_levels_above_full_scale_are_noticed(tmp_path: Path) -> None:
    description = document()
    description["camera"] = {"full_scale": 100.0}
    (finding,) = read_capture(make_capture(tmp_path, description)).findings
    assert finding.severity == "warning"
    assert "above full_scale = 100" in finding.message


def test_a_colour_white_frame_is_kept_in_colour(tmp_path: Path) -> None:
    folder = make_capture(tmp_path)
    colour = pixels("white", shape=(HEIGHT, WIDTH, 3))
    write_raw(folder / "white.png", colour[..., ::-1])
    capture = read_capture(folder)
    assert capture.colour is not None
    np.testing.assert_array_equal(capture.colour, colour)
    np.testing.assert_array_equal(capture.frames[3][0], to_grey(colour))
    assert [str(finding) for finding in capture.findings] == [
        "note: 1 of 7 images are colour (first: white.png): converted to grey (BT.601 luma)."
    ]


def test_a_colour_set_keeps_its_channels_and_so_do_white_and_black(tmp_path: Path) -> None:
    description = document()
    described = {"kind": "colour", "axis": "x", "period_px": 8.0, "palette": ["red", "green"]}
    description["set"] += [
        {"kind": "uniform", "level": 0.0, "images": ["black.png"]},
        {**described, "images": ["c.png", "d.png"], "repeats": 2},
    ]
    folder = make_capture(tmp_path, description)
    seen = {name: pixels(name, shape=(HEIGHT, WIDTH, 3)) for name in ("black", "white", "c", "d")}
    for name, image in seen.items():
        write_raw(folder / f"{name}.png", image[..., ::-1])
    capture = read_capture(folder)
    assert capture.colour is not None
    assert capture.dark_colour is not None
    np.testing.assert_array_equal(capture.colour, seen["white"])
    np.testing.assert_array_equal(capture.dark_colour, seen["black"])
    np.testing.assert_array_equal(capture.frames[4][0], to_grey(seen["black"]))
    np.testing.assert_array_equal(capture.frames[5], np.stack([seen["c"], seen["d"]]))
    assert capture.shape == (HEIGHT, WIDTH)
    assert [str(finding) for finding in capture.findings] == [
        "note: 2 of 10 images are colour (first: white.png): converted to grey (BT.601 luma)."
    ]


def test_a_colour_set_of_which_one_image_is_grey_is_grey(tmp_path: Path) -> None:
    description = document()
    described = {"kind": "colour", "axis": "x", "period_px": 8.0, "palette": ["red", "green"]}
    description["set"].append({**described, "images": ["c.png", "d.png"], "repeats": 2})
    folder = make_capture(tmp_path, description)
    write_raw(folder / "c.png", pixels("c", shape=(HEIGHT, WIDTH, 3)))
    assert read_capture(folder).frames[4].shape == (2, HEIGHT, WIDTH)


def test_colour_of_another_uniform_frame_is_not_the_whites(tmp_path: Path) -> None:
    description = document()
    description["set"].append({"kind": "uniform", "level": 0.5, "images": ["half.png"]})
    folder = make_capture(tmp_path, description)
    write_raw(folder / "half.png", pixels("half", shape=(HEIGHT, WIDTH, 3)))
    assert read_capture(folder).colour is None
    del description["set"][3]
    write_toml(folder, description)
    assert read_capture(folder).colour is None


def test_grey_that_was_saved_as_rgb_is_not_colour(tmp_path: Path) -> None:
    folder = make_capture(tmp_path)
    write_raw(folder / "white.png", np.repeat(pixels("white.png")[..., None], 3, axis=-1))
    capture = read_capture(folder)
    assert capture.colour is None
    np.testing.assert_array_equal(capture.frames[3][0], pixels("white.png"))


def test_jpeg_is_read_with_a_warning(tmp_path: Path) -> None:
    description = document()
    description["set"][3]["images"] = ["white.jpg"]
    (finding,) = read_capture(make_capture(tmp_path, description)).findings
    assert finding.severity == "warning"
    assert finding.message.startswith("1 of 7 images are JPEG (first: white.jpg)")


def test_spare_bits_are_noticed(tmp_path: Path) -> None:
    description = document()
    description["set"][1]["images"] = ["g0.png", "g1.png", "g2.png"]
    capture = read_capture(make_capture(tmp_path, description))
    assert capture.sequence.sets[1].pattern == GrayCode("x", 3, 8.0)
    (finding,) = capture.findings
    assert finding.message.startswith("set 2 (gray): 3 bits where 2 cover the projector")


@pytest.mark.parametrize(("given", "missing"), [("gain", "read_noise"), ("read_noise", "gain")])
def test_half_of_the_noise_is_noticed(tmp_path: Path, given: str, missing: str) -> None:
    description = document()
    description["camera"] = {given: 0.5}
    assert [
        str(finding) for finding in read_capture(make_capture(tmp_path, description)).findings
    ] == [
        f"note: {missing} is not given: gain and read_noise are both needed, so the noise is "
        f"estimated from the images instead. Set {missing} in [camera]."
    ]


@pytest.mark.parametrize(
    ("one", "other", "place"),
    [
        ("f0.png", "f2.png", "set 1 (fringe)"),
        ("g0.png", "g1.png", "set 2 (gray)"),
        ("g1.png", "half.png", "set 2 (gray)"),
        ("g0.png", "h1.png", "set 2 (gray)"),
    ],
)
def test_equal_frames_are_noticed(tmp_path: Path, one: str, other: str, place: str) -> None:
    description = document()
    description["set"][1].update(inverted=["h0.png", "h1.png"], complementary="half.png")
    folder = make_capture(tmp_path, description)
    write_raw(folder / other, pixels(one))
    assert [str(finding) for finding in read_capture(folder).findings] == [
        f"warning: {place}: {one} and {other} are the same image. "
        "Was one copied over the other? Record it again."
    ]


def test_equal_frames_that_are_as_they_should_be(tmp_path: Path) -> None:
    """Repeats, shifts a turn apart, and bits that are dark everywhere."""
    description = document()
    names = [f"f{shift}{repeat}.png" for shift in range(4) for repeat in "ab"]
    fringe = {"repeats": 2, "shifts_deg": [0.0, 120.0, 240.0, 360.0], "images": names}
    description["set"][0].update(fringe)
    folder = make_capture(tmp_path, description)
    for other in ("f0b.png", "f3a.png", "f3b.png"):
        write_raw(folder / other, pixels("f0a.png"))
    for bit in ("g0.png", "g1.png"):
        write_raw(folder / bit, np.zeros((HEIGHT, WIDTH), np.uint8))
    assert read_capture(folder).findings == ()


def test_images_may_stand_in_folders_below(tmp_path: Path) -> None:
    description = document()
    description["set"][3]["images"] = ["flat/white.png"]
    capture = read_capture(make_capture(tmp_path, description))
    np.testing.assert_array_equal(capture.frames[3][0], pixels("flat/white.png"))


def test_progress_sees_every_image(tmp_path: Path) -> None:
    seen = []

    class Shown:
        def __call__(self, items: Sequence[Item], description: str) -> Iterable[Item]:
            for item in items:
                seen.append(description)
                yield item

    capture = read_capture(make_capture(tmp_path), progress=Shown())
    assert seen == ["reading images"] * 7
    np.testing.assert_array_equal(capture.frames[3][0], pixels("white.png"))


REAL: dict[str, dict[str, Any]] = {
    "procam-graycode/capture_0": {"shape": (1024, 1280), "images": [10, 10, 1, 1]},
    "procam-half/capture_3": {"shape": (512, 640), "images": [10, 10, 1, 1]},
    "psp3-gray-mugs": {"shape": (1216, 1936), "images": [3, 3, 3, 3, 5, 4, 1, 1]},
    "gamma-plane": {"shape": (1216, 1936), "images": [3, 3, 10, 10, 1, 1]},
    "fourstep-dome": {"shape": (512, 658), "images": [4]},
}


@pytest.mark.parametrize("name", REAL)
def test_real_captures(real: Callable[[str], Path], name: str) -> None:
    base, _, below = name.partition("/")
    capture: Capture = read_capture(real(base) / below)
    assert capture.shape == REAL[name]["shape"]
    assert [len(stack) for stack in capture.frames] == REAL[name]["images"]
    assert capture.sensor.full_scale == 255
    assert len(capture.findings) == (name == "fourstep-dome")
    if capture.sequence.sets[-1].pattern == Uniform(0.0):
        assert capture.frames[-2].mean() > 3 * capture.frames[-1].mean()
