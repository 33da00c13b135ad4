from __future__ import annotations

import math
import tomllib
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest
import tomlkit
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fringeworks.errors import FormatError, UsageError
from fringeworks.files import read_sensor, write_sensor
from fringeworks.twin.effects import AmbientEffects, CameraEffects, Effects, ProjectorEffects

CURVE = ((0.0, 0.0), (0.25, 0.1), (1.0, 1.0))
OTHER = Effects(
    CameraEffects(
        bits=12,
        exposure_ms=3.5,
        full_well_e=8000.0,
        read_noise_e=7.0,
        black_level=16.0,
        prnu=0.02,
        dsnu=0.001,
        blur_px=0.0,
        vignetting=0.3,
        pixel_seed=7,
        shot_noise=False,
        colour_response=((0.9, 0.1, 0.0), (0.1, 0.7, 0.1), (0.0, 0.2, 0.8)),
    ),
    ProjectorEffects(
        light_per_ms=0.1,
        bits=10,
        gamma=2.2,
        response=CURVE,
        black_light=0.01,
        lattice="diamond",
        blur_px=0.5,
        focus_mm=700.0,
        defocus_px_m=2.0,
        vignetting=0.1,
        flicker=0.0,
    ),
    AmbientEffects(light_per_ms=0.0, ripple=0.05, mains_hz=60.0),
    frame_interval_ms=20.0,
    bounces=1,
    samples=16,
)


@pytest.mark.parametrize("effects", [Effects(), OTHER, Effects.ideal(), Effects().without_noise()])
def test_round_trip(tmp_path: Path, effects: Effects) -> None:
    write_sensor(tmp_path / "sensor.toml", effects)
    assert read_sensor(tmp_path / "sensor.toml") == effects


shares = st.floats(0, 0.5)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(exposure=st.floats(1e-3, 1e3), prnu=shares, blur=st.floats(0, 5), ripple=shares)
def test_no_digit_is_lost(
    tmp_path: Path, exposure: float, prnu: float, blur: float, ripple: float
) -> None:
    effects = Effects(
        CameraEffects(exposure_ms=exposure, prnu=prnu),
        ProjectorEffects(blur_px=blur),
        AmbientEffects(ripple=ripple),
    )
    write_sensor(tmp_path / "sensor.toml", effects)
    assert read_sensor(tmp_path / "sensor.toml") == effects


def test_the_file_says_every_key(tmp_path: Path) -> None:
    """So that it still means the same when a default changes."""
    write_sensor(tmp_path / "sensor.toml", OTHER)
    document = tomllib.loads((tmp_path / "sensor.toml").read_text())
    assert document.pop("format") == "fringeworks-sensor/1"
    assert document["projector"].pop("response") == [list(point) for point in CURVE]
    expected = asdict(OTHER)
    del expected["projector"]["response"]
    rows = [list(row) for row in expected["camera"].pop("colour_response")]
    assert document["camera"].pop("colour_response") == rows
    assert document == expected


def read(folder: Path, **tables: Any) -> Effects:
    document = {"format": "fringeworks-sensor/1", **tables}
    (folder / "sensor.toml").write_text(tomlkit.dumps(document), encoding="utf-8")
    return read_sensor(folder / "sensor.toml")


def test_what_is_not_given_is_the_default(tmp_path: Path) -> None:
    assert read(tmp_path) == Effects()
    given = read(tmp_path, camera={"exposure_ms": 20}, samples=1)
    assert given == Effects(CameraEffects(exposure_ms=20.0), samples=1)


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        ({"format": "sensor"}, "format must be 'fringeworks-sensor/1', got 'sensor'"),
        ({"light": {}}, "unknown key 'light'; known here: format, camera, projector, ambient, f"),
        ({"camera": {"exposure": 1}}, "unknown key 'camera.exposure', did you mean 'exposure_ms'"),
        ({"projector": {"focus": 1}}, "unknown key 'projector.focus', did you mean 'focus_mm'"),
        ({"camera": 3}, "camera must be a table, got 3"),
        ({"camera": {"bits": 8.0}}, "camera.bits must be a whole number, got 8.0"),
        ({"camera": {"shot_noise": 1}}, "camera.shot_noise must be true or false, got 1"),
        ({"camera": {"blur_px": "0.6"}}, "camera.blur_px must be a number, got '0.6'"),
        ({"camera": {"blur_px": math.nan}}, "camera.blur_px must be a finite number, got nan"),
        ({"ambient": {"mains_hz": math.inf}}, "ambient.mains_hz must be a finite number, got i"),
        ({"projector": {"lattice": "hexagon"}}, "projector.lattice must be 'square', 'diamond' or"),
        ({"projector": {"response": [[0, 0, 1]]}}, r"projector.response\[0\] must hold .* 2 en"),
        ({"projector": {"response": 2.2}}, "projector.response must be a list, got 2.2"),
        ({"samples": 9}, "samples must be 1, 4 or 16, got 9"),
        ({"bounces": 2}, "bounces must be 0 or 1, got 2"),
    ],
)
def test_refusals(tmp_path: Path, tables: dict[str, Any], message: str) -> None:
    with pytest.raises(FormatError, match=message) as caught:
        read(tmp_path, **tables)
    assert str(tmp_path / "sensor.toml") in str(caught.value)


@pytest.mark.parametrize(
    ("table", "key", "value"),
    [
        ("camera", "exposure_ms", 0.0),
        ("camera", "bits", 7),
        ("camera", "bits", 17),
        ("camera", "full_well_e", -1.0),
        ("camera", "read_noise_e", -1.0),
        ("camera", "colour_response", [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
        ("camera", "colour_response", [[1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
        ("camera", "colour_response", [[1.0, -0.1, 0.1], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
        ("projector", "light_per_ms", -0.1),
        ("projector", "gamma", 0.0),
        ("projector", "response", [[0.0, 0.0], [0.6, 0.4], [0.5, 0.5], [1.0, 1.0]]),
        ("projector", "focus_mm", 0.0),
        ("projector", "flicker", -0.1),
        ("ambient", "light_per_ms", -0.1),
        ("ambient", "mains_hz", -50.0),
    ],
)
def test_values_that_make_no_sense_are_the_files(
    tmp_path: Path, table: str, key: str, value: Any
) -> None:
    """`twin.check` knows which; here they are errors of the file, by its path and key."""
    with pytest.raises(FormatError, match=rf"sensor\.toml: .*{key}"):
        read(tmp_path, **{table: {key: value}})


FORMATS = (Path(__file__).parents[2] / "docs" / "formats.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("noun", [CameraEffects, ProjectorEffects, AmbientEffects])
def test_the_page_has_each_key_with_its_default(noun: type[Any]) -> None:
    title = noun.__name__.removesuffix("Effects").lower()
    start = FORMATS.index(f"| `[{title}]` |")
    rows = FORMATS[start : FORMATS.index("\n\n", start)].splitlines()[2:]
    cells = [[cell.strip(" `") for cell in row.strip("|").split("|")] for row in rows]
    said = {key: tomllib.loads(f"value = {default}")["value"] for key, _, default, _ in cells}
    shown = {key: [] if value == () else value for key, value in asdict(noun()).items()}
    assert said == shown


def test_the_pages_example(tmp_path: Path) -> None:
    start = FORMATS.index('format = "fringeworks-sensor/1"')
    (tmp_path / "sensor.toml").write_text(FORMATS[start : FORMATS.index("```", start)])
    assert read_sensor(tmp_path / "sensor.toml").projector.lattice == "diamond"


def test_what_cannot_be_written(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="exposure_ms"):
        write_sensor(tmp_path / "sensor.toml", Effects(CameraEffects(exposure_ms=0.0)))
    with pytest.raises(UsageError, match=r"this sensor could not be read back: .*must be a finite"):
        write_sensor(tmp_path / "sensor.toml", Effects(CameraEffects(blur_px=math.nan)))
    assert list(tmp_path.iterdir()) == []
