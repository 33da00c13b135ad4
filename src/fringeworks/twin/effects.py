"""What light, lenses and electronics do to a capture: every effect with its magnitude and unit.

Zero switches an effect off. The defaults are those of an industrial camera and a pico projector
in pattern mode. `Effects.ideal` has none of them.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal, TypeAlias

LEAST_MS, MOST_MS = 1e-3, 6e4
"""Shortest and longest exposure, and interval between frames."""

MOST_SEED = 2**63 - 1

Lattice: TypeAlias = Literal["square", "diamond", "none"]
ColourResponse: TypeAlias = tuple[tuple[float, float, float], ...]


@dataclass(frozen=True, slots=True)
class CameraEffects:
    """The camera.

    Attributes
    ----------
    bits
        Depth of the grey levels, 8 to 16: full scale is 2^bits - 1.
    exposure_ms
        Exposure of sets that do not say their own.
    full_well_e
        Electrons at full scale: shot noise is the root of the electrons.
    read_noise_e
        Standard deviation of the read noise, electrons.
    black_level
        Grey level without light.
    prnu
        Pixel gains: standard deviation as a share.
    dsnu
        Pixel offsets: standard deviation, share of full scale.
    blur_px
        Standard deviation of the lens' point spread, camera px.
    vignetting
        Share of the light lost in the image's corner; it grows with the squared distance from
        the principal point.
    pixel_seed
        Seed of the pixels' gains and offsets: the same camera in every capture.
    shot_noise
        Whether electrons arrive at random.
    colour_response
        Empty: a grey camera. Else three rows, red, green and blue channel: what each receives of
        the projector's red, green and blue light, as a share of white. Off the diagonal stands
        crosstalk; a row's sum is the channel's gain on white, so that of ambient light too. Every
        pixel has all three channels: there is no mosaic of filters.
    """

    bits: int = 8
    exposure_ms: float = 10.0
    full_well_e: float = 12_000.0
    read_noise_e: float = 20.0
    black_level: float = 0.0
    prnu: float = 0.01
    dsnu: float = 0.002
    blur_px: float = 0.6
    vignetting: float = 0.15
    pixel_seed: int = 0
    shot_noise: bool = True
    colour_response: ColourResponse = ()


@dataclass(frozen=True, slots=True)
class ProjectorEffects:
    """The projector.

    Attributes
    ----------
    light_per_ms
        Share of the camera's full scale, per ms of exposure, that white on a white surface
        (albedo 1) facing the projector at `focus_mm` gives in both images' middle.
    bits
        Depth of the shown images, 8 to 16.
    gamma
        Light as a power of the level: 1 in pattern mode, 1.8 to 2.4 for video projectors.
    response
        Points (level, light), both 0 to 1 and rising, joined by a monotone cubic; in place of
        gamma.
    black_light
        Light of a black pixel, share of a white one's.
    lattice
        Shape of the pixels: "square" ones side by side; "diamond" ones on a lattice whose odd rows
        stand half a column to the right (DLP3000); "none" for light that runs smoothly through
        the pixels' centres, which no real projector has.
    blur_px
        Standard deviation of the point spread in focus, projector px (columns).
    focus_mm
        Depth, along the projector's axis, of best focus.
    defocus_px_m
        Growth of the point spread: px per 1/m of ``|1/z - 1/focus|``, added in quadrature.
    vignetting
        As the camera's.
    flicker
        Standard deviation of the light from frame to frame, as a share.
    """

    light_per_ms: float = 0.08
    bits: int = 8
    gamma: float = 1.0
    response: tuple[tuple[float, float], ...] = ()
    black_light: float = 0.002
    lattice: Lattice = "square"
    blur_px: float = 0.4
    focus_mm: float = 650.0
    defocus_px_m: float = 3.2
    vignetting: float = 0.25
    flicker: float = 0.003


@dataclass(frozen=True, slots=True)
class AmbientEffects:
    """Light that the projector does not make.

    Attributes
    ----------
    light_per_ms
        Share of the camera's full scale, per ms, that it gives on a white surface.
    ripple
        Amplitude of its ripple at twice the mains' frequency, as a share.
    mains_hz
        Frequency of the mains; 0 without ripple.
    """

    light_per_ms: float = 0.006
    ripple: float = 0.01
    mains_hz: float = 50.0


@dataclass(frozen=True, slots=True)
class Effects:
    """All of them, and the rhythm of the frames.

    Attributes
    ----------
    frame_interval_ms
        From the start of one exposure to the next.
    bounces
        1: light that goes from one surface to another on its way is seen too; 0: it is not.
    samples
        Rays per camera pixel: 1, 4 or 16.
    """

    camera: CameraEffects = field(default_factory=CameraEffects)
    projector: ProjectorEffects = field(default_factory=ProjectorEffects)
    ambient: AmbientEffects = field(default_factory=AmbientEffects)
    frame_interval_ms: float = 33.3
    bounces: Literal[0, 1] = 0
    samples: Literal[1, 4, 16] = 4

    def without_noise(self) -> Effects:
        """The same light without anything random, shown and seen in 16 bits."""
        camera = replace(
            self.camera, bits=16, read_noise_e=0.0, prnu=0.0, dsnu=0.0, shot_noise=False
        )
        return replace(
            self,
            camera=camera,
            projector=replace(self.projector, flicker=0.0, bits=16),
        )

    @classmethod
    def ideal(cls) -> Effects:
        """Nothing but geometry, cosine and distance: no blur, no noise, no pixels."""
        projector = ProjectorEffects(
            bits=16,
            black_light=0.0,
            lattice="none",
            blur_px=0.0,
            defocus_px_m=0.0,
            vignetting=0.0,
            flicker=0.0,
        )
        camera = CameraEffects(
            bits=16,
            read_noise_e=0.0,
            prnu=0.0,
            dsnu=0.0,
            blur_px=0.0,
            vignetting=0.0,
            shot_noise=False,
        )
        ambient = AmbientEffects(light_per_ms=0.0, ripple=0.0)
        return cls(camera, projector, ambient, samples=1)


def crosstalk_response(share: float) -> ColourResponse:
    """Channels that see this share of each neighbouring primary's light in place of their own.

    Red and blue have one neighbour in the spectrum, green has two; white is one in each channel.
    """
    return (
        (1 - share, share, 0.0),
        (share, 1 - 2 * share, share),
        (0.0, share, 1 - share),
    )
