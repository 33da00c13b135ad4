"""Read and write ``sensor.toml``: what light, lenses and electronics do in the twin."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

from fringeworks.files.atomic import write_text
from fringeworks.files.nouns import describe_noun, make_noun, table_of
from fringeworks.files.toml import lay_out_toml
from fringeworks.files.validation import check_format, read_toml, refusing, validated
from fringeworks.twin.effects import Effects

SENSOR_FORMAT = "fringeworks-sensor/1"

SensorFile = table_of(Effects, format=(Literal["fringeworks-sensor/1"], ...))
"""The whole ``sensor.toml``: the fields of `Effects` and its parts, under their names."""


def read_sensor(path: str | Path) -> Effects:
    """The effects of a ``sensor.toml``; what it does not say is as in ``Effects()``.

    Raises
    ------
    FormatError
        Not TOML, a key unknown or of the wrong type, or a value that makes no sense.
    """
    path = Path(path)
    return _parse(read_toml(path), path)


def write_sensor(path: str | Path, effects: Effects) -> None:
    """Write ``sensor.toml`` with every key, atomic; it reads back as it is.

    Raises
    ------
    UsageError
        Effects that `read_sensor` would refuse.
    FormatError
        The file cannot be written.
    """
    path = Path(path)
    document = {"format": SENSOR_FORMAT, **describe_noun(effects)}
    write_text(path, lay_out_toml(document, lambda again: _parse(again, path), what="sensor"))


def _parse(document: dict[str, Any], path: Path) -> Effects:
    from fringeworks.twin.check import check_effects  # brings numba

    check_format(document, SENSOR_FORMAT, path)
    effects = make_noun(Effects, validated(SensorFile, document, path))
    with refusing(path):
        check_effects(effects)
    return effects
