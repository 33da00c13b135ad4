"""`examples/lay_out.py` against checkouts like those of the real repositories."""

from __future__ import annotations

import importlib.util
import shutil
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from fringeworks.files import read_board, read_capture, read_image

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


@pytest.fixture(scope="module")
def script() -> Iterator[ModuleType]:
    spec = importlib.util.spec_from_file_location("lay_out", EXAMPLES / "lay_out.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["lay_out"] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    yield module
    del sys.modules["lay_out"]


Checkout = Callable[[str], Path]


@pytest.fixture
def checkout(tmp_path: Path, real: Callable[[str], Path], script: ModuleType) -> Checkout:
    """A folder like a checkout of the repository that a set comes from."""

    def make(name: str) -> Path:
        root = tmp_path / "checkout"
        inside = root / script.SOURCES[name].images_in
        for image in script.image_names(EXAMPLES / name):
            (inside / image).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(real(name) / image, inside / image)
        (root / "LICENSE").write_text("the author's licence")
        return root

    return make


@pytest.mark.parametrize("name", ["psp3-gray-mugs", "gamma-plane", "fourstep-dome"])
def test_single_captures(
    tmp_path: Path, checkout: Checkout, real: Callable[[str], Path], script: ModuleType, name: str
) -> None:
    said: list[str] = []
    arguments = [name, str(checkout(name)), "--out", str(tmp_path / "data")]
    assert script.main(arguments, said.append) == 0
    folder = tmp_path / "data" / "real" / name
    assert said == [f"{folder}: laid out; use it with FRINGEWORKS_DATA={tmp_path / 'data'}"]
    one, other = read_capture(folder), read_capture(real(name))
    assert one.sequence == other.sequence
    np.testing.assert_array_equal(one.frames[-1], other.frames[-1])
    assert (folder / "LICENSE").read_text() == "the author's licence"


def test_four_poses_from_the_repository(
    tmp_path: Path, checkout: Checkout, script: ModuleType
) -> None:
    root = checkout("procam-graycode")
    (root / "sample_data" / "calibration_result.xml").write_text("<xml/>")
    folder = script.lay_out("procam-graycode", root, tmp_path / "data")
    assert (folder / "author_calibration_result.xml").exists()
    assert read_board(folder / "board.toml").columns == 7
    assert read_capture(folder / "capture_2").shape == (1024, 1280)
    assert sorted(path.name for path in folder.glob("capture_*")) == [
        f"capture_{i}" for i in range(4)
    ]


def test_the_half_size_sample(
    tmp_path: Path, checkout: Checkout, real: Callable[[str], Path], script: ModuleType
) -> None:
    root = checkout("procam-graycode")
    # few images are enough: all others are empty here
    images = script.image_names(EXAMPLES / "procam-graycode")
    kept = ["capture_0/graycode_00.png", "capture_3/graycode_40.png"]
    for image in set(images) - set(kept):
        shutil.copyfile(root / "sample_data" / kept[0], root / "sample_data" / image)
    folder = script.lay_out("procam-graycode", root / "sample_data", tmp_path, half=True)
    assert folder == tmp_path / "sample" / "procam-half"
    for image in kept:
        np.testing.assert_array_equal(
            read_image(folder / image), read_image(real("procam-half") / image)
        )
    assert read_board(folder / "board.toml").rows == 9


def test_missing_images_are_named(
    tmp_path: Path, script: ModuleType, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "figures").mkdir()
    for step in ("000", "090"):
        (tmp_path / "figures" / f"lens_crop_{step}.jpg").write_bytes(b"")
    assert script.main(["fourstep-dome", str(tmp_path), "--out", str(tmp_path / "data")]) == 1
    assert capsys.readouterr().err == (
        f"lay_out: {tmp_path / 'figures'}: 2 of 4 images are missing: lens_crop_180.jpg, "
        "lens_crop_270.jpg\ngive a checkout of nzhagen/fpp_tools (commit aa71ef7), whose figures "
        "has them\n"
    )
    assert not (tmp_path / "data").exists()


def test_wrong_use(tmp_path: Path, script: ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    assert script.main(["gamma-plane", str(tmp_path / "none"), "--out", str(tmp_path)]) == 1
    assert "none: no such folder; give a checkout of kamino410/phase" in capsys.readouterr().err
    assert script.main(["gamma-plane", str(tmp_path), "--out", str(tmp_path), "--half"]) == 1
    assert "--half is for procam-graycode alone" in capsys.readouterr().err


def test_the_descriptions_are_those_of_the_data(real: Callable[[str], Path]) -> None:
    for path in sorted(EXAMPLES.rglob("*.toml")):
        if path.name == "acceptance.toml":  # a plan for what is measured on them
            continue
        below = path.relative_to(EXAMPLES)
        original = real(below.parts[0]).joinpath(*below.parts[1:])
        assert path.read_text() == original.read_text()
