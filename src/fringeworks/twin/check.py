"""Scenes and effects that cannot be, said in words before any ray is cast."""

from __future__ import annotations

from collections.abc import Sequence
from operator import attrgetter

import numpy as np

from fringeworks.errors import UsageError
from fringeworks.model import Pose
from fringeworks.twin.effects import LEAST_MS, MOST_MS, MOST_SEED, ColourResponse, Effects
from fringeworks.twin.meshes import check_mesh
from fringeworks.twin.scene import (
    MOST_MM,
    Blend,
    Board,
    Box,
    Capsule,
    Cone,
    Cylinder,
    Material,
    Mesh,
    Object,
    Plane,
    Scene,
    Shape,
    Sphere,
)
from fringeworks.twin.texture import print_of
from fringeworks.twin.truth import Truth

ROTATION_TOLERANCE = 1e-6

LEAST_MM = 1e-6
"""Smallest size of a shape."""

LONGEST_NAME = 100
MARKER_SHARES = (0.3, 0.99)
"""Smallest and largest marker of a ChArUco board, as a share of its square."""

MOST_OF_ALL = 1e6
"""A magnitude beyond this is no effect of any device."""

LEAST = {
    "camera.exposure_ms": LEAST_MS,
    "camera.full_well_e": 1.0,
    "projector.focus_mm": 1.0,
    "projector.gamma": 1e-3,
    "projector.light_per_ms": 1e-12,
    "frame_interval_ms": LEAST_MS,
}
"""What cannot be zero, and how small it may be."""

MOST = {
    "camera.exposure_ms": MOST_MS,
    "camera.full_well_e": 1e15,
    "camera.read_noise_e": 1e15,
    "camera.prnu": 1.0,
    "camera.dsnu": 1.0,
    "camera.pixel_seed": MOST_SEED,
    "camera.blur_px": 20.0,
    "projector.light_per_ms": 1e3,
    "projector.blur_px": 20.0,
    "projector.flicker": 1.0,
    "ambient.light_per_ms": 1e3,
    "frame_interval_ms": MOST_MS,
}
"""Other bounds: the work of a blur grows with its width, and single precision has to hold the
product of the largest."""


MAGNITUDES = (
    *("camera.exposure_ms", "camera.full_well_e", "projector.light_per_ms", "projector.gamma"),
    *("projector.focus_mm", "frame_interval_ms", "camera.read_noise_e", "camera.black_level"),
    *("camera.prnu", "camera.dsnu", "camera.pixel_seed", "camera.blur_px", "projector.blur_px"),
    *("projector.defocus_px_m", "projector.flicker", "ambient.light_per_ms", "ambient.mains_hz"),
)
SHARES = ("camera.vignetting", "projector.vignetting", "projector.black_light", "ambient.ripple")


def check_scene(scene: Scene) -> None:
    """Refuse a scene that cannot be.

    Raises
    ------
    UsageError
        No object, two of one name, a size that is not positive, a material that gives back more
        light than it gets, a place that is no rigid motion, a mesh or board that cannot be used, or
        `posed` that names no object. The message names the object.
    """
    names = [thing.name for thing in scene.objects]
    if not names:
        raise UsageError(f"scene {scene.name!r} must have an object, got none")
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise UsageError(f"object names must differ, got {twice[0]!r} twice")
    _check_poses(scene, names)
    for thing in scene.objects:
        _check_object(thing)


def check_view(truth: Truth, *, scene: str) -> None:
    """Refuse a scene, called `scene` in messages, of which the rig sees, or lights, nothing.

    Raises
    ------
    UsageError
        No camera pixel meets an object, or the projector lights none of what the camera sees.
    """
    if not (truth.surface >= 0).any():
        raise UsageError(
            f"scene {scene!r}: the camera sees nothing of it ({', '.join(truth.names)}): all lies "
            "outside the view or behind the camera; check where its objects stand (position_mm in "
            "a scene.toml, camera_from_object) and the units (mm)"
        )
    if not np.isfinite(truth.column).any():
        raise UsageError(
            f"scene {scene!r}: the projector lights nothing of what the camera sees: the rig "
            "points away from the scene; check the projector's place (device_from_rig in a "
            "rig.json, projector_from_camera), and that the two fields of view meet at the scene's "
            "depth"
        )


def check_effects(effects: Effects) -> None:
    """Refuse magnitudes that make no sense.

    Raises
    ------
    UsageError
        The message names the effect.
    """
    for name in MAGNITUDES:
        least, most = LEAST.get(name, 0.0), MOST.get(name, MOST_OF_ALL)
        value = attrgetter(name)(effects)
        _require(least <= value <= most, name, f"{least:g} to {most:g}", value)
    for name in SHARES:
        value = attrgetter(name)(effects)
        _require(0 <= value <= 1, name, "a share, 0 to 1", value)
    _check_choices(effects)


def _check_choices(effects: Effects) -> None:
    camera, projector = effects.camera, effects.projector
    for name, bits in (("camera.bits", camera.bits), ("projector.bits", projector.bits)):
        _require(bits in range(8, 17), name, "8 to 16", bits)
    full = 2**camera.bits - 1
    _require(camera.black_level < full, "camera.black_level", f"below {full}", camera.black_level)
    lattices = ("square", "diamond", "none")
    known = projector.lattice in lattices
    _require(known, "projector.lattice", f"one of {', '.join(lattices)}", projector.lattice)
    _require(effects.samples in (1, 4, 16), "samples", "1, 4 or 16", effects.samples)
    _require(effects.bounces in (0, 1), "bounces", "0 or 1", effects.bounces)
    _check_response(projector.response)
    _check_colour_response(camera.colour_response)


def _check_response(response: tuple[tuple[float, float], ...]) -> None:
    if not response:
        return
    points = np.array(response, dtype=np.float64)
    inside = bool(((points >= 0) & (points <= 1)).all())
    rises = len(points) > 1 and bool((np.diff(points, axis=0) > 0).all())
    expected = "two points or more (level, light), 0 to 1, both rising"
    _require(inside and rises, "projector.response", expected, response)


def _check_colour_response(response: ColourResponse) -> None:
    if not response:
        return
    rows = np.array(response, dtype=np.float64)
    square = rows.shape == (3, 3) and bool((rows >= 0).all() and (rows.sum(axis=1) > 0).all())
    small = square and bool((rows <= MOST_OF_ALL).all())
    expected = "three rows of three shares, none below 0, each with light of one primary at least"
    _require(small, "camera.colour_response", expected, response)


def _check_poses(scene: Scene, names: list[str]) -> None:
    if scene.posed is not None and scene.posed not in names:
        offered = ", ".join(names)
        raise UsageError(f"posed must be one of the objects ({offered}), got {scene.posed!r}")
    if scene.poses and scene.posed is None:
        raise UsageError("poses must come with posed, the name of the object they place")
    for index, pose in enumerate(scene.poses):
        _check_pose(pose, f"poses[{index}]")


def _check_object(thing: Object) -> None:
    name = thing.name[: LONGEST_NAME + 1]
    known = 0 < len(name) <= LONGEST_NAME and name.isprintable()
    _require(known, "an object's name", f"1 to {LONGEST_NAME} printable characters", repr(name))
    _check_pose(thing.camera_from_object, f"{thing.name}.camera_from_object")
    _require_lengths(thing.velocity_mm_s, f"{thing.name}.velocity_mm_s")
    _check_material(thing.material, thing.name)
    _check_shape(thing.shape, thing.name)


def _check_pose(pose: Pose, name: str) -> None:
    rotation = np.asarray(pose.rotation)
    rigid = np.allclose(rotation @ rotation.T, np.eye(3), rtol=0, atol=ROTATION_TOLERANCE)
    proper = rigid and np.linalg.det(rotation) > 0
    _require(proper, f"{name}'s rotation", "a rotation matrix", rotation.tolist())
    _require_lengths(pose.translation_mm.tolist(), f"{name}'s translation")


def _check_material(material: Material, name: str) -> None:
    for key in ("albedo", "dark_albedo", "gloss"):
        value = getattr(material, key)
        _require(0 <= value <= 1, f"{name}.{key}", "0 to 1", value)
    total = material.albedo + material.gloss
    _require(total <= 1 + 1e-9, f"{name}: albedo + gloss", "at most 1", total)
    n = material.gloss_exponent
    _require(0 < n <= MOST_OF_ALL, f"{name}.gloss_exponent", f"above 0, at most {MOST_OF_ALL:g}", n)


def _check_shape(shape: Shape, name: str) -> None:
    match shape:
        case Mesh():
            check_mesh(shape)
        case Blend():
            _check_blend(shape, name)
        case Board():
            _check_board(shape, name)
        case Plane():
            for key in ("width_mm", "height_mm"):
                value = getattr(shape, key)
                _require(value >= LEAST_MM, f"{name}.{key}", f"at least {LEAST_MM:g}", value)
        case Box():
            _require_sizes(shape.size_mm, f"{name}.size_mm")
        case Sphere():
            _require_sizes([shape.radius_mm], f"{name}.radius_mm")
        case Cylinder():
            _require_sizes([shape.radius_mm, shape.length_mm], f"{name}: radius and length")
        case Cone():
            _require_sizes([shape.radius_mm, shape.height_mm], f"{name}: radius and height")


def _check_blend(blend: Blend, name: str) -> None:
    _require(len(blend.capsules) > 0, f"{name}.capsules", "one or more", 0)
    smooth = blend.smooth_mm
    _require(0 <= smooth <= MOST_MM, f"{name}.smooth_mm", f"0 to {MOST_MM:g}", smooth)
    for index, capsule in enumerate(blend.capsules):
        _check_capsule(capsule, f"{name}.capsules[{index}]")


def _check_capsule(capsule: Capsule, name: str) -> None:
    _require_sizes([capsule.start_radius_mm, capsule.end_radius_mm], f"{name}: radii")
    _require_lengths((*capsule.start_mm, *capsule.end_mm), f"{name}: ends")


def _check_board(board: Board, name: str) -> None:
    for key in ("columns", "rows"):
        count = getattr(board, key)
        _require(count >= 2, f"{name}.{key}", "2 inner corners or more", count)
    _require_sizes([board.square_mm], f"{name}.square_mm")
    not_below_zero = {"margin_mm": board.margin_mm, "print_sigma_mm": board.print_sigma_mm}
    for key, value in not_below_zero.items():
        _require(0 <= value <= MOST_MM, f"{name}.{key}", f"0 to {MOST_MM:g}", value)
    sigma = board.print_sigma_mm
    limit = board.square_mm / 10
    _require(sigma <= limit, f"{name}.print_sigma_mm", f"at most a tenth square ({limit:g})", sigma)
    scale = all(abs(value) < 0.5 for value in board.print_scale)
    _require(scale, f"{name}.print_scale", "shares between -0.5 and 0.5", board.print_scale)
    _require_lengths(board.bow_mm, f"{name}.bow_mm")
    seed = board.print_seed
    _require(0 <= seed <= MOST_SEED, f"{name}.print_seed", f"0 to {MOST_SEED}", seed)
    known = board.kind in ("checkerboard", "charuco", "circles")
    _require(known, f"{name}.kind", "checkerboard, charuco or circles", board.kind)
    if board.kind == "charuco":
        _check_marker(board, name)
    print_of(board)


def _check_marker(board: Board, name: str) -> None:
    """Markers of next to nothing would be drawn on a raster that fills the memory."""
    least, most = (share * board.square_mm for share in MARKER_SHARES)
    fits = board.marker_mm is not None and least <= board.marker_mm <= most
    expected = f"{least:g} to {most:g} on squares of {board.square_mm:g} mm"
    _require(fits, f"{name}.marker_mm", expected, board.marker_mm)


def _require_sizes(values: Sequence[float], name: str) -> None:
    inside = all(LEAST_MM <= value <= MOST_MM for value in values)
    _require(inside, name, f"{LEAST_MM:g} to {MOST_MM:g}", tuple(values))


def _require_lengths(values: Sequence[float], name: str) -> None:
    inside = all(abs(value) <= MOST_MM for value in values)
    _require(inside, name, f"-{MOST_MM:g} to {MOST_MM:g}", values)


def _require(holds: bool, name: str, expected: str, actual: object) -> None:
    if not holds:
        raise UsageError(f"{name} must be {expected}, got {actual}")
