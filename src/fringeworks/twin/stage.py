"""Scene, rig and effects together: show an image to the projector, get what the camera sees.

What only geometry decides is found once; where objects move, once per frame, at the middle of its
exposure.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import UsageError
from fringeworks.model import Frames, Pose, Rig, Sensor
from fringeworks.twin.blur import blur
from fringeworks.twin.bounce import Bounce, find_bounce
from fringeworks.twin.cast import Caster
from fringeworks.twin.check import check_effects, check_scene, check_view
from fringeworks.twin.effects import Effects
from fringeworks.twin.expose import ambient_exposure, make_chip
from fringeworks.twin.light import Lamp
from fringeworks.twin.optics import optics_of
from fringeworks.twin.scene import Object, Scene
from fringeworks.twin.shade import View, find_view
from fringeworks.twin.truth import Truth, find_truth

Floats: TypeAlias = NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class _Moment:
    """All that is ready before an image is shown; `ambient` is seen through the camera's lens."""

    view: View
    lamp: Lamp
    ambient: Floats
    bounce: Bounce | None


class Stage:
    """A scene before a rig.

    Raises
    ------
    UsageError
        The scene or the effects cannot be, or the rig sees or lights nothing (`check`).
    """

    def __init__(self, scene: Scene, rig: Rig, effects: Effects | None = None) -> None:
        self.scene = scene
        self.rig = rig
        self.effects = effects or Effects()
        check_scene(scene)
        check_effects(self.effects)
        self.camera, self.projector = optics_of(rig)
        self._chip = make_chip(
            self.effects.camera, width=self.camera.width, height=self.camera.height
        )
        self._moves = any(item.moves for item in scene.objects)
        self._still: _Moment | None = None
        self._first_truth = self._find_truth(0.0)
        check_view(self._first_truth, scene=scene.name)

    @property
    def sensor(self) -> Sensor:
        """The camera's truth, grey levels."""
        return self._chip.sensor

    def expose(
        self,
        image: Frames,
        *,
        rng: np.random.Generator,
        time_s: float = 0.0,
        exposure_ms: float | None = None,
    ) -> Frames:
        """One frame of the camera while the projector shows an image.

        Parameters
        ----------
        image
            Grey levels ``(height, width)`` of the projector at its effects' bits, or red, green and
            blue ones ``(height, width, 3)``; a grey camera sees the mean of those.
        rng
            Light, electrons and electronics draw from it.
        time_s
            When the exposure starts, since the scene stood at its poses.
        exposure_ms
            The camera effects' unless told.

        Returns
        -------
        Frames
            ``(H, W)``, of a colour camera ``(H, W, 3)``; uint8 for a camera of 8 bits, else uint16.

        Raises
        ------
        ShapeError
            The image is not the projector's size.
        UsageError
            Its levels exceed the projector's bits; the exposure is not above zero.
        """
        exposure_ms = self.effects.camera.exposure_ms if exposure_ms is None else exposure_ms
        if not 0 < exposure_ms < np.inf:
            raise UsageError(f"exposure_ms must be above 0, got {exposure_ms:g}")
        moment = self._moment(time_s + exposure_ms / 2000)
        white = self.effects.projector.light_per_ms * exposure_ms
        white *= 1 + self.effects.projector.flicker * rng.standard_normal()
        ambient = ambient_exposure(self.effects.ambient, time_s=time_s, exposure_ms=exposure_ms)
        shown = self._project_primaries(moment, image)
        return self._read(
            shown * np.float32(max(white, 0.0)), moment.ambient * np.float32(ambient), rng
        )

    def truth(self, time_s: float = 0.0) -> Truth:
        """Where each camera pixel looks and which projector pixel lights it, at a time."""
        moved = self._moves and time_s != 0
        return self._find_truth(time_s) if moved else self._first_truth

    def _find_truth(self, time_s: float) -> Truth:
        return find_truth(Caster(self._scene_at(time_s)), self.camera, self.projector)

    def _project_primaries(self, moment: _Moment, image: Frames) -> Floats:
        """``(1, H, W)`` of a grey image or for a grey camera, else ``(3, H, W)``: as `_project`."""
        if image.ndim == 2:
            return self._project(moment, image)[None]
        if not self.effects.camera.colour_response:
            grey: Frames = np.round(image.mean(axis=-1)).astype(image.dtype)
            return self._project(moment, grey)[None]
        return np.stack([self._project(moment, image[..., c]) for c in range(3)])

    def _read(self, shown: Floats, ambient: Floats, rng: np.random.Generator) -> Frames:
        """Grey levels of the projector's light ``(1 or 3, H, W)`` and the ambient ``(H, W)``."""
        response = np.array(self.effects.camera.colour_response, np.float32)
        if not response.size:
            return self._chip.read(shown[0] + ambient, rng)
        lights = np.broadcast_to(shown, (3, *ambient.shape)) + ambient
        channels = np.tensordot(response, lights, axes=1)
        seen: list[Any] = [self._chip.read(channel, rng) for channel in channels]
        frame: Frames = np.stack(seen, axis=-1)
        return frame

    def _project(self, moment: _Moment, image: Frames) -> Floats:
        """What the camera's lens makes of a shown image ``(H, W)``, white being about one."""
        light = moment.lamp.show(image).gather(moment.view.samples)
        if moment.bounce is not None:
            indirect = moment.bounce.gather(
                moment.lamp.light(image), width=self.camera.width, height=self.camera.height
            )
            cells = np.ones((self._side, self._side), np.float32)
            light += np.kron(indirect, cells) * moment.view.reflected
        return self._through_lens(light)

    def _through_lens(self, light: Floats) -> Floats:
        """Light ``(H n, W n)`` at rays, blurred while it is that fine, as ``(H, W)`` pixels."""
        side = self._side
        variance = (self.effects.camera.blur_px * side) ** 2
        fine = blur(light, across=variance, down=variance)
        rows = fine.reshape(self.camera.height, side, self.camera.width, side)
        return np.asarray(rows.mean(axis=(1, 3), dtype=np.float32))

    @property
    def _side(self) -> int:
        """Rays per pixel along each axis."""
        return math.isqrt(self.effects.samples)

    def _moment(self, time_s: float) -> _Moment:
        if self._still is None:
            moment = self._prepare(Caster(self._scene_at(time_s)))
            if self._moves:
                return moment
            self._still = moment
        return self._still

    def _prepare(self, caster: Caster) -> _Moment:
        camera, projector, effects = self.camera, self.projector, self.effects
        view = find_view(caster, camera, projector, effects=effects)
        ratio = projector.lens.fy / projector.lens.fx
        lamp = Lamp(effects.projector, projector.width, projector.height, ratio, view.sigmas_px)
        bounce = None
        if effects.bounces:
            bounce = find_bounce(caster, camera, projector, effects=effects.projector)
        return _Moment(view, lamp, self._through_lens(view.reflected), bounce)

    def _scene_at(self, time_s: float) -> Scene:
        if not self._moves:
            return self.scene
        return replace(
            self.scene, objects=tuple(_object_at(item, time_s) for item in self.scene.objects)
        )


def _object_at(item: Object, time_s: float) -> Object:
    """The object where it is after a time."""
    pose = item.camera_from_object
    moved = pose.translation_mm + time_s * np.array(item.velocity_mm_s)
    return replace(item, camera_from_object=Pose(pose.rotation, moved))
