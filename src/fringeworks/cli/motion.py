"""``--motion``: a scene that moved evenly, brought back to one moment before it is decoded."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from fringeworks.cli.arguments import parse_numbers
from fringeworks.errors import UsageError

if TYPE_CHECKING:
    from fringeworks.cli.output import Output
    from fringeworks.model import Capture
    from fringeworks.phase.motion import Motion

MotionOption = Annotated[
    str | None,
    typer.Option(
        "--motion",
        metavar="DX,DY",
        help="The scene moved evenly while it was captured: by so many camera px per frame in "
        "the image, as 0.5,0, or auto: find it. It is brought back to the middle of the finest "
        "fringes [default: it stood still].",
    ),
]
OtherLightOption = Annotated[
    bool,
    typer.Option(
        "--other-light",
        help="Void pixels that get light by way of other surfaces, by two periods of one axis.",
    ),
]


def hold_asked(capture: Capture, asked: str | None) -> tuple[Capture, Motion | None]:
    """The capture as if its scene had stood still, where that is asked for.

    Raises
    ------
    UsageError
        The option is neither ``auto`` nor two numbers.
    """
    if asked is None:
        return capture, None
    from fringeworks.diagnose.image_motion import estimate_image_motion
    from fringeworks.phase.motion import hold_still

    chosen = capture.select()
    if asked.strip().lower() == "auto":
        return hold_still(chosen, estimate_image_motion(chosen))
    numbers = parse_numbers(asked, option="--motion")
    if len(numbers) != 2:
        raise UsageError(
            f"--motion must be DX,DY in camera px per frame, as 0.5,0, or auto, got '{asked}'"
        )
    return hold_still(chosen, (numbers[0], numbers[1]))


def tell_motion(output: Output, motion: Motion | None) -> None:
    """The lines of what was compensated."""
    if motion is None:
        return
    if motion.still:
        output.facts([("motion", "none found: the frames stay as they are")])
        return
    x, y = motion.image_px
    rates = ", ".join(f"{rate:+.3f} px along {axis}" for axis, rate in motion.rates_px)
    output.facts(
        [
            ("motion taken out", f"({x:+.3f}, {y:+.3f}) camera px per frame"),
            ("", f"projector, per frame: {rates}"),
            ("holds for", f"frame {motion.reference:g} of the capture"),
            ("misfit of the fringes", f"{motion.before:.2%} before, {motion.after:.2%} after"),
        ]
    )


def summarise_motion(motion: Motion | None) -> dict[str, Any] | None:
    """What ``--json`` says of it."""
    if motion is None:
        return None
    return {
        "image_px": list(motion.image_px),
        "projector_px": dict(motion.rates_px),
        "reference_frame": motion.reference,
        "misfit_before": motion.before,
        "misfit_after": motion.after,
        "still": motion.still,
    }
