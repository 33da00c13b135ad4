"""Read and write ``rig.json``: camera, projector and how they stand to each other."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from fringeworks.errors import FormatError, UsageError
from fringeworks.files.atomic import write_text
from fringeworks.files.rig_schema import (
    FURTHER_KEYS,
    RIG_FORMAT,
    DeviceTable,
    ResidualTable,
    RigFile,
)
from fringeworks.files.validation import MAX_TEXT_BYTES, check_format, read_json, validated
from fringeworks.geometry.pose import compose_poses
from fringeworks.model.residual import ResidualField, Three, count_terms
from fringeworks.model.rig import Camera, Extended, Lens, Pose, Projector, Quality, Rig

ROTATION_TOLERANCE = 1e-6
"""Largest deviation of any element of R R^T from the unit matrix."""

_UNITS = {"length": "mm", "angle": "rad", "image": "px"}
_LENS_KEYS = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")


def read_rig(path: str | Path) -> Rig:
    """The rig of a ``rig.json``: lengths mm, lenses px; its frame is the camera's.

    Raises
    ------
    FormatError
        Not JSON, a key missing, unknown or out of bounds, a rotation that is none, or other
        than one camera and one projector.
    """
    path = Path(path)
    return _parse(read_json(path), path)


def _parse(document: dict[str, Any], path: Path) -> Rig:
    check_format(document, RIG_FORMAT, path)
    file = validated(RigFile, document, path)
    camera, projector = _one(file, "camera", path), _one(file, "projector", path)
    camera_from_rig = _pose(camera, path)
    projector_from_rig = _pose(projector, path)
    return Rig(
        camera=Camera(camera.width, camera.height, _lens(camera)),
        projector=Projector(projector.width, projector.height, _lens(projector)),
        projector_from_camera=_compose(projector_from_rig, camera_from_rig.inverse()),
        volume_mm=_volume(file, path),
        quality=None if file.quality is None else Quality(**file.quality.model_dump()),
        scale_sigma=file.scale_sigma,
        extended=None if file.extended is None else Extended(**file.extended.model_dump()),
        residual=_residual(file.residual, path),
        further={key: document[key] for key in FURTHER_KEYS if key in document},
    )


def write_rig(path: str | Path, rig: Rig) -> None:
    """Write ``rig.json``, atomic; every number reads back as it is.

    Arrays in `Rig.further` become lists and their NaN null (``np.array(..., dtype=float)`` reads
    both back).

    Raises
    ------
    UsageError
        `Rig.further` has a key that is not one of the format's, a value JSON cannot hold, or more
        than `read_rig` would read.
    FormatError
        The file cannot be written.
    """
    path = Path(path)
    try:
        text = _lay_out(_describe(rig)) + "\n"
        _parse(json.loads(text), path)
    except FormatError as error:
        raise UsageError(f"this rig could not be read back: {error}") from None
    except (TypeError, ValueError) as error:
        raise UsageError(f"this rig cannot be written as JSON: {error}") from error
    size = len(text.encode())
    if size > MAX_TEXT_BYTES:
        raise UsageError(
            f"rig.further must fit into {MAX_TEXT_BYTES} bytes of JSON with the rig, got {size}: "
            "calibrate from fewer views, or with fewer corners"
        )
    write_text(path, text)


def _lay_out(value: Any, indent: str = "") -> str:
    """JSON with a key a line, and every list that holds no table on one line."""
    inner, (opened, closed) = indent + " ", "[]" if isinstance(value, list) else "{}"
    if isinstance(value, dict) and value:
        items = [f"{json.dumps(str(key))}: {_lay_out(item, inner)}" for key, item in value.items()]
    elif isinstance(value, list) and any(isinstance(item, dict) for item in value):
        items = [_lay_out(item, inner) for item in value]
    else:
        return json.dumps(value, allow_nan=False)
    lines = ",\n".join(inner + item for item in items)
    return f"{opened}\n{lines}\n{indent}{closed}"


def _describe(rig: Rig) -> dict[str, Any]:
    unknown = sorted(set(rig.further) - set(FURTHER_KEYS))
    if unknown:
        raise UsageError(f"rig.further must have keys of {FURTHER_KEYS}, got {unknown}")
    document: dict[str, Any] = {
        "format": RIG_FORMAT,
        "units": _UNITS,
        "devices": {
            "camera": _describe_device("camera", rig.camera, Pose.identity()),
            "projector": _describe_device("projector", rig.projector, rig.projector_from_camera),
        },
    }
    if rig.volume_mm is not None:
        document["volume_mm"] = dict(zip(("z_min", "z_max"), rig.volume_mm, strict=True))
    if rig.quality is not None:
        document["quality"] = asdict(rig.quality)
    if rig.scale_sigma is not None:
        document["scale_sigma"] = rig.scale_sigma
    if rig.extended is not None:
        document["extended"] = asdict(rig.extended)
    if rig.residual:
        document["residual"] = [_plain(asdict(field)) for field in rig.residual]
    further = {key: _plain(rig.further[key]) for key in FURTHER_KEYS if key in rig.further}
    return {**document, **further}


def _one(file: RigFile, kind: str, path: Path) -> DeviceTable:
    names = [name for name, device in file.devices.items() if device.kind == kind]
    if len(names) != 1:
        listed = f" ({', '.join(names)})" if names else ""
        raise FormatError(
            f"{path}: devices must hold one {kind}, got {len(names)}{listed}; "
            "rigs of several cameras or projectors are planned"
        )
    return file.devices[names[0]]


def _lens(device: DeviceTable) -> Lens:
    return Lens(*(getattr(device, key) for key in _LENS_KEYS))


def _pose(device: DeviceTable, path: Path) -> Pose:
    table = device.device_from_rig
    rotation = np.array(table.rotation, dtype=np.float64)
    with np.errstate(over="ignore", invalid="ignore"):
        off = np.abs(rotation @ rotation.T - np.eye(3)).max()
        right_handed = np.linalg.det(rotation) > 0
    if not off <= ROTATION_TOLERANCE or not right_handed:
        what = f"R R^T is off by {off:.3g}" if not off <= ROTATION_TOLERANCE else "it mirrors"
        raise FormatError(
            f"{path}: the {device.kind}'s device_from_rig.rotation must be a rotation, but {what}"
        )
    return Pose(rotation, np.array(table.translation_mm, dtype=np.float64))


def _compose(outer: Pose, inner: Pose) -> Pose:
    return Pose(
        *compose_poses(
            (outer.rotation, outer.translation_mm), (inner.rotation, inner.translation_mm)
        )
    )


def _volume(file: RigFile, path: Path) -> tuple[float, float] | None:
    if file.volume_mm is None:
        return None
    near, far = file.volume_mm.z_min, file.volume_mm.z_max
    if not near < far:
        raise FormatError(f"{path}: volume_mm.z_max must be > z_min = {near:g}, got {far:g}")
    return near, far


def _residual(tables: Sequence[ResidualTable], path: Path) -> tuple[ResidualField, ...]:
    belongs = [(table.model, table.axis) for table in tables]
    for place, table in enumerate(tables):
        if belongs[place] in belongs[:place]:
            raise FormatError(
                f"{path}: residual[{place}] is a second field of the {table.model} model along "
                f"{table.axis}"
            )
        if not all(low < high for low, high in zip(table.low, table.high, strict=True)):
            raise FormatError(f"{path}: residual[{place}].high must be > low, each of the three")
        wanted, given = count_terms(table.order), len(table.coefficients)
        if given != wanted:
            raise FormatError(
                f"{path}: residual[{place}].coefficients must be {wanted} for order "
                f"{table.order}, got {given}"
            )
    return tuple(_field(table) for table in tables)


def _field(table: ResidualTable) -> ResidualField:
    return ResidualField(
        model=table.model,
        axis=table.axis,
        order=table.order,
        middle=_three(table.middle),
        low=_three(table.low),
        high=_three(table.high),
        coefficients=tuple(table.coefficients),
        gain=table.gain,
        gain_sigma=table.gain_sigma,
    )


def _three(values: list[float]) -> Three:
    a, b, c = values
    return a, b, c


def _describe_device(kind: str, device: Camera | Projector, pose: Pose) -> dict[str, Any]:
    return {
        "kind": kind,
        "width": device.width,
        "height": device.height,
        **dict(zip(_LENS_KEYS, device.lens.vector.tolist(), strict=True)),
        "device_from_rig": {
            "rotation": pose.rotation.tolist(),
            "translation_mm": pose.translation_mm.tolist(),
        },
    }


def _plain(value: Any) -> Any:
    """The same with arrays as lists, and NaN, which JSON does not know, as null."""
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return None if isinstance(value, float) and np.isnan(value) else value
