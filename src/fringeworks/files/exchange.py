"""Calibrations of other programs as rigs, and rigs as theirs: OpenCV, SLStudio, MATLAB, ROS.

A foreign file is first brought to matrices under one set of names, in OpenCV's conventions: pixel
centres at whole numbers, columns as vectors, the camera first. `docs/exchange.md` says what each
format means by its numbers.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import FormatError, UsageError
from fringeworks.files.atomic import replacing, write_text
from fringeworks.files.foreign_mat import read_mat, write_mat
from fringeworks.files.foreign_storage import read_storage
from fringeworks.files.validation import clip, shorten
from fringeworks.geometry.pose import invert_pose
from fringeworks.model import Camera, Lens, Pose, Projector, Rig

Array = NDArray[np.float64]
Size: TypeAlias = tuple[int, int]
Unit = Literal["mm", "cm", "m"]

UNITS: Mapping[str, float] = {"mm": 1.0, "cm": 10.0, "m": 1000.0}
SHORTEST_BASELINE = 5.0
"""Shorter ones, in mm, are taken for metres or for squares of the board, unless a unit is given."""

MATRIX_SUFFIXES = (".yml", ".yaml", ".xml")
ROTATION_TOLERANCE = 1e-3
"""Files round: what is closer to a rotation is made one."""

NAMES: Mapping[str, tuple[str, ...]] = {
    "camera_matrix": (
        "cam_K", "Cam_K", "cam_int", "Kc", "M1", "K1", "cameraMatrix1", "camera_matrix",
    ),
    "camera_distortion": (
        "cam_kc", "Cam_kc", "cam_dist", "kc", "D1", "distCoeffs1", "camera_distortion",
        "distortion_coefficients",
    ),
    "projector_matrix": (
        "proj_K", "Proj_K", "pro_K", "proj_int", "Kp", "M2", "K2", "cameraMatrix2",
        "projector_matrix",
    ),
    "projector_distortion": (
        "proj_kc", "Proj_kc", "Proj_Kc", "pro_kc", "proj_dist", "kp", "D2", "distCoeffs2",
        "projector_distortion",
    ),
    "rotation": ("R", "Rp", "rotation", "roration"),  # the last is one program's own spelling
    "translation": ("T", "Tp", "translation"),
}  # fmt: skip
"""What a rig's matrices are called, to the letter: ``Kc`` is a matrix, ``kc`` its lens."""

SIZE_NAMES: Mapping[str, tuple[str, ...]] = {
    "camera": ("camera_size", "cam_size"),
    "projector": ("projector_size", "proj_size", "pro_size"),
}
SIDES: Mapping[str, tuple[tuple[str, str], ...]] = {
    "camera": (("frameWidth", "frameHeight"), ("image_width", "image_height")),
    "projector": (("screenResX", "screenResY"),),
}


@dataclass(frozen=True, slots=True)
class Given:
    """What a file does not say: sizes as (width, height), px, and the unit of its lengths."""

    camera: Size | None = None
    projector: Size | None = None
    unit: Unit | None = None


def read_foreign(path: str | Path, given: Given | None = None) -> Rig:
    """A rig from OpenCV's YAML or XML (SLStudio's too) or from MATLAB's ``.mat``.

    Rotation and translation must map the first device, the camera, to the second.

    Raises
    ------
    FormatError
        The file cannot be read, lacks a matrix (what it has is listed), or holds a lens beyond
        five terms, skewed pixels, or a rotation that is none.
    UsageError
        A size or the unit is not in the file and not given; the suffix is unknown.
    """
    path, given = Path(path), given or Given()
    suffix = path.suffix.lower()
    if suffix in MATRIX_SUFFIXES:
        values = read_storage(path)
    elif suffix == ".mat":
        values = read_mat(path)
    else:
        raise UsageError(f"{path}: must be .yml, .yaml, .xml or .mat, got '{path.suffix}'")
    found = {role: _named(values, role, path) for role in NAMES}
    camera = _lens(found, "camera", path)
    projector = _lens(found, "projector", path)
    turn = _rotation(found["rotation"], path)
    return Rig(
        Camera(*(given.camera or _size(values, "camera", path)), camera),
        Projector(*(given.projector or _size(values, "projector", path)), projector),
        Pose(turn, _translation(found["translation"], given.unit, path)),
    )


def write_opencv(path: str | Path, rig: Rig) -> list[Path]:
    """OpenCV's FileStorage, YAML or XML by suffix; `read_foreign` reads it back as it is."""
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in MATRIX_SUFFIXES:
        raise UsageError(f"--out must be .yml, .yaml or .xml for opencv, got '{path.name}'")
    form = cv2.FILE_STORAGE_FORMAT_XML if suffix == ".xml" else cv2.FILE_STORAGE_FORMAT_YAML
    storage = cv2.FileStorage(suffix, cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY | form)
    pose = rig.projector_from_camera
    for name, device in (("cam", rig.camera), ("proj", rig.projector)):
        storage.write(f"{name}_size", np.array([[device.width, device.height]], dtype=np.int32))
        storage.write(f"{name}_K", camera_matrix(device.lens))
        storage.write(f"{name}_kc", device.lens.vector[4:][None])
    storage.write("R", pose.rotation)
    storage.write("T", pose.translation_mm[:, None])
    write_text(path, storage.releaseAndGetString())
    return [path]


def write_matlab(path: str | Path, rig: Rig) -> list[Path]:
    """A ``.mat`` of version 5 to 7 with `stereoParams` as a struct; see `foreign_mat`."""
    path = Path(path)
    if path.suffix.lower() != ".mat":
        raise UsageError(f"--out must be .mat for mat, got '{path.name}'")
    with replacing(path) as temporary:
        write_mat(temporary, rig)
    return [path]


def write_ros(folder: str | Path, rig: Rig) -> list[Path]:
    """``camera.yaml`` and ``projector.yaml`` as camera_info, ``transform.yaml`` in metres.

    camera_info has no place for a pose between two devices, hence the third.
    """
    folder = Path(folder)
    if folder.suffix:
        raise UsageError(f"--out must be a folder for ros, got '{folder.name}'")
    texts = {
        "camera": _camera_info("camera", rig.camera),
        "projector": _camera_info("projector", rig.projector),
        "transform": _transform(rig),
    }
    paths = [folder / f"{name}.yaml" for name in texts]
    for path, text in zip(paths, texts.values(), strict=True):
        write_text(path, text)
    return paths


def camera_matrix(lens: Lens) -> Array:
    """``(3, 3)``, pixel centres at whole numbers."""
    return np.array([[lens.fx, 0, lens.cx], [0, lens.fy, lens.cy], [0, 0, 1.0]])


def _named(values: Mapping[str, Any], role: str, path: Path) -> Array:
    for name in NAMES[role]:
        if values.get(name) is not None:
            matrix = np.asarray(values[name], dtype=np.float64)
            if not np.isfinite(matrix).all():
                raise FormatError(
                    f"{path}: {name} must hold numbers, got {shorten(matrix.tolist())}"
                )
            return matrix
    listed = ", ".join(sorted(values)) or "nothing"
    raise FormatError(
        f"{path}: no {role.replace('_', ' ')}: one of {', '.join(NAMES[role])} is needed, "
        f"the file has {clip(listed)}"
    )


def _size(values: Mapping[str, Any], device: str, path: Path) -> Size:
    for name in SIZE_NAMES[device]:
        size = values.get(name)
        if size is not None and np.size(size) == 2 and _finite(size):
            width, height = np.ravel(size)
            return int(width), int(height)
    for sides in SIDES[device]:
        width, height = (np.ravel(values.get(side, np.nan)) for side in sides)
        if width.size == height.size == 1 and _finite(width) and _finite(height):
            return int(width[0]), int(height[0])
    raise UsageError(
        f"{path}: does not say how large the {device}'s image is: give it with --{device} "
        "WIDTHxHEIGHT"
    )


def _finite(values: Any) -> bool:
    """Whether they are numbers at all; what a file holds besides reads as None."""
    return bool(np.isfinite(np.asarray(values, dtype=np.float64)).all())


def _lens(found: Mapping[str, Array], device: str, path: Path) -> Lens:
    matrix, terms = found[f"{device}_matrix"], np.ravel(found[f"{device}_distortion"])
    if matrix.shape != (3, 3):
        raise FormatError(f"{path}: the {device}'s matrix must be 3x3, got {matrix.shape}")
    if abs(matrix[0, 1]) > 1e-6 * abs(matrix[0, 0]):
        raise FormatError(
            f"{path}: the {device}'s pixels are skewed ({matrix[0, 1]:g}), which rig.json does "
            "not know"
        )
    if len(terms) < 4 or terms[5:].any():
        raise FormatError(
            f"{path}: the {device}'s distortion must be k1 k2 p1 p2 and k3, got {len(terms)} "
            "terms: solve again without the rational, thin prism or tilted model"
        )
    five = np.zeros(5)
    five[: min(len(terms), 5)] = terms[:5]
    return Lens(matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2], *five.tolist())


def _rotation(matrix: Array, path: Path) -> Array:
    """The nearest rotation; rotation vectors are taken too."""
    if matrix.size == 3:
        matrix = np.asarray(cv2.Rodrigues(matrix.reshape(3, 1))[0], dtype=np.float64)
    if matrix.shape != (3, 3):
        raise FormatError(f"{path}: the rotation must be 3x3, got {matrix.shape}")
    left, _, right = np.linalg.svd(matrix)
    nearest = left @ right
    off = float(np.abs(nearest - matrix).max())
    if off > ROTATION_TOLERANCE or np.linalg.det(nearest) < 0:
        raise FormatError(f"{path}: the rotation is none: it is off by {off:.3g}, or mirrors")
    return np.asarray(nearest)


def _translation(values: Array, unit: Unit | None, path: Path) -> Array:
    if values.size != 3:
        raise FormatError(f"{path}: the translation must be three numbers, got {values.size}")
    length = float(np.linalg.norm(values))
    if unit is None and length < SHORTEST_BASELINE:
        raise UsageError(
            f"{path}: camera and projector stand {length:.3g} apart, which cannot be mm; if it is "
            "in metres, give --unit m; if it is mm, --unit mm"
        )
    return np.ravel(values) * UNITS[unit or "mm"]


def _camera_info(name: str, device: Camera | Projector) -> str:
    matrix = camera_matrix(device.lens)
    projection = np.hstack([matrix, np.zeros((3, 1))])
    tables = (
        ("camera_matrix", matrix),
        ("distortion_coefficients", device.lens.vector[4:][None]),
        ("rectification_matrix", np.eye(3)),
        ("projection_matrix", projection),
    )
    lines = [f"image_width: {device.width}", f"image_height: {device.height}"]
    lines += [f"camera_name: {name}", "distortion_model: plumb_bob"]
    for key, table in tables:
        rows, columns = table.shape
        lines += [f"{key}:", f"  rows: {rows}", f"  cols: {columns}"]
        lines.append(f"  data: {table.ravel().tolist()}")
    return "\n".join(lines) + "\n"


def _transform(rig: Rig) -> str:
    """What ROS calls the transform from parent camera to child projector."""
    from scipy.spatial.transform import Rotation

    pose = rig.projector_from_camera
    rotation, translation = invert_pose(pose.rotation, pose.translation_mm)
    lines = [
        "parent: camera",
        "child: projector",
        f"translation_m: {(translation / 1000).tolist()}",
        f"rotation_xyzw: {Rotation.from_matrix(rotation).as_quat().tolist()}",
    ]
    return "\n".join(lines) + "\n"
