from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from fringeworks.errors import FormatError, UsageError
from fringeworks.files import read_rig, write_rig
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.model import Camera, Extended, Lens, Pose, Projector, Quality, Rig
from fringeworks.twin.optics import optics_of
from fringeworks.twin.scenes import RIGS, named_rig

RIG = Rig(
    camera=Camera(752, 480, Lens(1974.1, 1970.2, 376.3, 240.4, -0.1, 0.05, 2e-4, -3e-4, 0.01)),
    projector=Projector(608, 684, Lens(1013.0, 1015.0, 300.0, 700.0, -0.05, 0.03)),
    projector_from_camera=Pose(
        rotation_matrix(np.array([0.02, -0.28, 0.01])), np.array([-180.0, 5.0, 20.0])
    ),
    volume_mm=(560.0, 780.0),
    quality=Quality(0.1, 0.2, 0.15, 12, 1000, 1010),
    scale_sigma=1.5e-4,
)


def assert_same(one: Rig, other: Rig) -> None:
    assert (one.camera, one.projector) == (other.camera, other.projector)
    assert (one.volume_mm, one.quality) == (other.volume_mm, other.quality)
    assert one.scale_sigma == other.scale_sigma
    pose, again = one.projector_from_camera, other.projector_from_camera
    np.testing.assert_array_equal(pose.rotation, again.rotation)
    np.testing.assert_array_equal(pose.translation_mm, again.translation_mm)


def test_round_trip(tmp_path: Path) -> None:
    write_rig(tmp_path / "rig.json", RIG)
    assert_same(read_rig(tmp_path / "rig.json"), RIG)


def test_the_extended_parameters_are_kept(tmp_path: Path) -> None:
    extended = Extended("y", 18.5, 0.1, 0.2, 3e-3, -4e-3, 5.0, 2.7, 17.9, -0.5, -6.975, 1 / 3)
    write_rig(tmp_path / "rig.json", replace(RIG, extended=extended))
    assert read_rig(tmp_path / "rig.json").extended == extended
    document = json.loads((tmp_path / "rig.json").read_text())["extended"]
    assert list(document) == ["axis", "period_px", *Extended.NAMES]
    assert document["Kz"] == 1 / 3
    assert read_rig(tmp_path / "rig.json").further == {}


def test_without_volume_and_quality(tmp_path: Path) -> None:
    rig = replace(RIG, volume_mm=None, quality=None, scale_sigma=None)
    write_rig(tmp_path / "rig.json", rig)
    assert_same(read_rig(tmp_path / "rig.json"), rig)


finite = st.floats(-1e6, 1e6)
lenses = st.builds(
    Lens, *([st.floats(1e-3, 1e6)] * 2), *([finite] * 2), *([st.floats(-100, 100)] * 5)
)
vectors = hnp.arrays(np.float64, 3, elements=st.floats(-10, 10))


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(camera=lenses, projector=lenses, turn=vectors, shift=vectors)
def test_no_digit_is_lost(
    tmp_path: Path, camera: Lens, projector: Lens, turn: Any, shift: Any
) -> None:
    pose = Pose(rotation_matrix(turn), 1e3 * shift)
    rig = Rig(Camera(640, 480, camera), Projector(608, 684, projector), pose)
    write_rig(tmp_path / "rig.json", rig)
    assert_same(read_rig(tmp_path / "rig.json"), rig)


def test_the_file_is_as_documented(tmp_path: Path) -> None:
    write_rig(tmp_path / "rig.json", RIG)
    document = json.loads((tmp_path / "rig.json").read_text())
    assert list(document) == ["format", "units", "devices", "volume_mm", "quality", "scale_sigma"]
    assert document["format"] == "fringeworks-rig/1"
    assert document["units"] == {"length": "mm", "angle": "rad", "image": "px"}
    camera = document["devices"]["camera"]
    assert camera["fx"] == 1974.1
    assert camera["device_from_rig"] == {
        "rotation": np.eye(3).tolist(),
        "translation_mm": [0.0, 0.0, 0.0],
    }
    assert document["volume_mm"] == {"z_min": 560.0, "z_max": 780.0}


def test_further_keys_are_kept(tmp_path: Path) -> None:
    further = {
        "transfer": {"axis": "x", "C1": 0.25},
        "covariance": np.array([[1.0, np.nan], [np.float32(0.5), 2.0]]),
        "response": {"levels": (np.int64(3), np.float64(0.1)), "note": None},
        "provenance": "a bench",
    }
    write_rig(tmp_path / "rig.json", replace(RIG, further=further))
    again = read_rig(tmp_path / "rig.json").further
    assert again == {
        "transfer": {"axis": "x", "C1": 0.25},
        "covariance": [[1.0, None], [0.5, 2.0]],
        "response": {"levels": [3, 0.1], "note": None},
        "provenance": "a bench",
    }
    covariance = np.array(again["covariance"], dtype=float)
    np.testing.assert_array_equal(covariance, further["covariance"])
    write_rig(tmp_path / "again.json", replace(RIG, further=again))
    assert (tmp_path / "again.json").read_text() == (tmp_path / "rig.json").read_text()


BEYOND = {
    "camera": {"k4": 0.02, "k5": -0.01, "k6": 0.01, "pupil_shift_mm": 0.5},
    "projector": {"pupil_shift_mm": -1},
}


@pytest.mark.parametrize("name", RIGS)
def test_named_rigs_read_back(tmp_path: Path, name: str) -> None:
    write_rig(tmp_path / "rig.json", named_rig(name))
    again = read_rig(tmp_path / "rig.json")
    assert_same(again, named_rig(name))
    assert again.further == named_rig(name).further


def test_what_the_twin_alone_reads_is_kept(tmp_path: Path) -> None:
    write_rig(tmp_path / "rig.json", replace(RIG, further={"twin": BEYOND}))
    again = read_rig(tmp_path / "rig.json")
    assert again.further == {"twin": BEYOND}
    camera, projector = optics_of(again)
    assert (camera.rational, camera.pupil_shift_mm) == ((0.02, -0.01, 0.01), 0.5)
    assert (projector.rational, projector.pupil_shift_mm) == ((0.0, 0.0, 0.0), -1.0)


def test_number_arrays_stand_on_one_line(tmp_path: Path) -> None:
    views = [{"name": "a", "camera_px": np.arange(6.0).reshape(3, 2), "left_out": {}}]
    write_rig(tmp_path / "rig.json", replace(RIG, further={"calibration": {"views": views}}))
    lines = (tmp_path / "rig.json").read_text().splitlines()
    assert '    "camera_px": [[0.0, 1.0], [2.0, 3.0], [4.0, 5.0]],' in lines
    assert '    "left_out": {}' in lines
    assert len(lines) < 70


def test_what_read_would_refuse_for_its_size_is_not_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    big = replace(RIG, further={"covariance": np.full((100, 100), 1 / 3)})
    write_rig(tmp_path / "rig.json", big)
    size = (tmp_path / "rig.json").stat().st_size
    monkeypatch.setattr("fringeworks.files.rig.MAX_TEXT_BYTES", size)
    write_rig(tmp_path / "rig.json", big)
    monkeypatch.setattr("fringeworks.files.rig.MAX_TEXT_BYTES", size - 1)
    with pytest.raises(UsageError, match=f"must fit into {size - 1} bytes .*, got {size}: "):
        write_rig(tmp_path / "new.json", big)
    assert not (tmp_path / "new.json").exists()


def document() -> dict[str, Any]:
    device = {"width": 10, "height": 8, "fx": 5.0, "fy": 5, "cx": 4.5, "cy": 3.5}
    still = {"rotation": np.eye(3).tolist(), "translation_mm": [0, 0, 0]}
    return {
        "format": "fringeworks-rig/1",
        "devices": {
            "left": {"kind": "camera", **device, "device_from_rig": still},
            "beamer": {"kind": "projector", **device, "device_from_rig": still},
        },
    }


def read(folder: Path, content: Any) -> Rig:
    text = content if isinstance(content, str) else json.dumps(content)
    (folder / "rig.json").write_text(text, encoding="utf-8")
    return read_rig(folder / "rig.json")


def test_the_rig_frame_becomes_the_cameras(tmp_path: Path) -> None:
    rig = document()
    camera = Pose(rotation_matrix(np.array([0.1, 0.2, 0.3])), np.array([1.0, 2.0, 3.0]))
    projector = Pose(rotation_matrix(np.array([-0.3, 0.1, 0.2])), np.array([4.0, -5.0, 6.0]))
    for name, pose in (("left", camera), ("beamer", projector)):
        rig["devices"][name]["device_from_rig"] = {
            "rotation": pose.rotation.tolist(),
            "translation_mm": pose.translation_mm.tolist(),
        }
    point = np.array([10.0, 20.0, 500.0])
    seen = read(tmp_path, rig).projector_from_camera.apply(camera.apply(point))
    np.testing.assert_allclose(seen, projector.apply(point), rtol=1e-13)


def in_beamer(**changes: Any) -> Callable[[dict[str, Any]], None]:
    return lambda rig: rig["devices"]["beamer"].update(changes)


def turned(rotation: Any) -> Callable[[dict[str, Any]], None]:
    return in_beamer(device_from_rig={"rotation": rotation, "translation_mm": [0, 0, 0]})


def at_top(**changes: Any) -> Callable[[dict[str, Any]], None]:
    return lambda rig: rig.update(changes)


def second_camera(rig: dict[str, Any]) -> None:
    rig["devices"]["right"] = rig["devices"]["left"]


SCALED = (1.00001 * np.eye(3)).tolist()
MIRROR = np.diag([1.0, 1.0, -1.0]).tolist()
QUALITY = dict.fromkeys(("camera_rms_px", "projector_rms_px", "joint_rms_px"), 0.1)


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (at_top(format="fringeworks-rig/9"), "format must be 'fringeworks-rig/1', got 'fring"),
        (at_top(weather="fine"), "unknown key 'weather'; known here: format, units, devices"),
        (at_top(extended={"axis": "x"}), "extended.period_px is missing"),
        (at_top(extended={"axis": "z", "period_px": 32}), "extended.axis must be 'x' or 'y'"),
        (at_top(extended={"axis": "x", "period_px": 0}), "extended.period_px must be > 0, got 0"),
        (
            at_top(extended={"axis": "x", "period_px": 32, "C5": 1}),
            "unknown key 'extended.C5'; known here: axis, period_px, C1",
        ),
        (at_top(extendet={}), "unknown key 'extendet', did you mean 'extended'"),
        (in_beamer(fz=3), "unknown key 'devices.beamer.fz'; known here: kind, width, h"),
        (in_beamer(fx=-1.0), "devices.beamer.fx must be > 0, got -1.0"),
        (in_beamer(fx="1"), "devices.beamer.fx must be a number, got '1'"),
        (in_beamer(width=0), "devices.beamer.width must be >= 1, got 0"),
        (in_beamer(kind="laser"), "devices.beamer.kind must be 'camera' or 'projector'"),
        (in_beamer(kind="camera"), r"one camera, got 2 \(left, beamer\); rigs of several"),
        (second_camera, r"devices must hold one camera, got 2 \(left, right\)"),
        (at_top(devices={}), "devices must hold one camera, got 0; "),
        (turned(SCALED), "the projector's device_from_rig.rotation must be a rotation, but R R"),
        (turned(MIRROR), "rotation must be a rotation, but it mirrors"),
        (turned([[1e200, 0, 0]] * 3), "must be a rotation, but R R\\^T is off by inf"),
        (turned([[1, 0], [0, 1]]), r"rotation\[0\] must hold 3 entries, got 2"),
        (at_top(volume_mm={"z_min": 5, "z_max": 5}), "volume_mm.z_max must be > z_min = 5, got 5"),
        (at_top(volume_mm={"z_min": 5}), "volume_mm.z_max is missing"),
        (at_top(units={"length": "m", "angle": "rad", "image": "px"}), "units.length must be 'mm'"),
        (at_top(twin={"laser": {}}), "unknown key 'twin.laser'; known here: camera, projector"),
        (
            at_top(twin={"camera": {"k7": 1}}),
            "unknown key 'twin.camera.k7'; known here: k4",
        ),
        (at_top(twin={"camera": {"k4": "1"}}), "twin.camera.k4 must be a number, got '1'"),
        (at_top(twin={"projector": 3}), "twin.projector must be a table, got 3"),
        (at_top(twin=None), "twin must be a table, got None"),
        (
            at_top(quality={**QUALITY, "views_used": -1}),
            "quality.views_used must be >= 0, got -1",
        ),
        (at_top(scale_sigma=-1e-4), "scale_sigma must be >= 0, got -0.0001"),
    ],
)
def test_refusals(tmp_path: Path, edit: Callable[[dict[str, Any]], None], message: str) -> None:
    rig = document()
    edit(rig)
    with pytest.raises(FormatError, match=message) as caught:
        read(tmp_path, rig)
    assert str(tmp_path / "rig.json") in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", r"not valid JSON: .*line 1 column 2"),
        ("[1, 2]", "must be a JSON object"),
        ("{}", "format must be 'fringeworks-rig/1', the key is missing"),
        ('{"format": NaN}', "not valid JSON: NaN is not a number that JSON knows"),
        ("[" * 100_000, "too deeply nested"),
    ],
)
def test_what_is_no_rig(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(FormatError, match=message):
        read(tmp_path, text)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"further": {"weather": 1}}, r"keys of .*, got \['weather'\]"),
        ({"further": {"twin": {"camera": {"k4": np.nan}}}}, "twin.camera.k4 must be a number"),
        ({"further": {"response": object()}}, "cannot be written as JSON"),
        ({"further": {"response": np.array([np.inf])}}, "cannot be written as JSON"),
        ({"camera": Camera(640, 480, Lens(np.nan, 1, 1, 1))}, "cannot be written as JSON"),
        ({"camera": Camera(640, 480, Lens(-1, 1, 1, 1))}, "fx must be > 0, got -1.0"),
        ({"projector_from_camera": Pose(2 * np.eye(3), np.zeros(3))}, "must be a rotation"),
    ],
)
def test_what_cannot_be_written(tmp_path: Path, changes: dict[str, Any], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        write_rig(tmp_path / "rig.json", replace(RIG, **changes))
    assert list(tmp_path.iterdir()) == []


@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_bytes_changed(tmp_path: Path, data: st.DataObject) -> None:
    text = bytearray(json.dumps({**document(), "volume_mm": {"z_min": 1, "z_max": 2}}).encode())
    for _ in range(data.draw(st.integers(1, 3))):
        start = data.draw(st.integers(0, len(text) - 1))
        text[start : start + data.draw(st.integers(0, 6))] = data.draw(st.binary(max_size=5))
    (tmp_path / "rig.json").write_bytes(text)
    try:
        read_rig(tmp_path / "rig.json")
    except FormatError as error:
        message = str(error)
    else:
        return
    assert "rig.json" in message
