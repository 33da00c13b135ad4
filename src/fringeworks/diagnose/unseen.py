"""What could not be looked for, and why: a clean answer says no more than was looked at."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from fringeworks.diagnose.look import Look
from fringeworks.model import Capture, Codeword, ProjectorMap, Rig


def find_unseen(
    capture: Capture, looks: Sequence[Look], decoded: ProjectorMap | None, rig: Rig | None
) -> Iterator[str]:
    """One sentence part for each lot of checks that this capture or call has nothing for."""
    if not looks:
        yield "exposure, light, motion, gamma, blur: there are no fringes"
    elif not any(look.enough for look in looks):
        yield "light, motion, gamma, blur: too few pixels see fringes"
    if capture.white() is None or capture.black() is None:
        yield "ambient light, blur, the Gray code's margin: they need a white and a black frame"
    if capture.sequence.reference_ms is not None:
        yield "motion from one exposure to the next: their images differ by light alone"
    if any(look.fringe.frame_count == 3 for look in looks):
        yield "motion and wrong shifts inside a set of three frames: it leaves no residual"
        if decoded is None:
            yield "gamma, flicker: of three frames they are seen in decoded coordinates alone"
    if capture.find(Codeword) and (rig is None or rig.z_window() is None):
        yield "the code frame: it is read inside the volume of a --rig"
    if rig is None:
        yield "epipolar lines, mirrored images, costs in mm: they need --rig"
    elif decoded is not None and (decoded.column is None or decoded.row is None):
        yield "epipolar lines, mirrored images: they need both axes"
