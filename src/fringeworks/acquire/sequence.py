"""Acquire a capture: pattern by pattern, resumable after whatever interrupts it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from fringeworks import __version__
from fringeworks.acquire.frames import FrameTaker, Shot
from fringeworks.acquire.journal import Journal
from fringeworks.acquire.locating import locate_code
from fringeworks.acquire.lock import locked
from fringeworks.devices import CameraDevice, Clock, MonotonicClock, ProjectorDevice
from fringeworks.errors import DeviceError, UsageError
from fringeworks.files.acquiring import Acquiring, Setting, Taken, Tally
from fringeworks.files.capture_writing import describe_capture
from fringeworks.files.station import Timing
from fringeworks.model import Frames, GreyCurve, PatternSet, Sequence
from fringeworks.model.progress import Progress, no_progress
from fringeworks.patterns import frame_names, render_sequence
from fringeworks.patterns.corner_code import CornerCode


@dataclass(frozen=True, slots=True)
class Acquisition:
    """What an acquisition has brought.

    Attributes
    ----------
    path
        Its ``capture.toml``.
    images
        How many images the capture has.
    taken
        How many of them this run took; an earlier one had the others.
    frames
        Frames of all runs that were not used.
    """

    path: Path
    images: int
    taken: int
    frames: Tally


def acquire_sequence(
    sequence: Sequence,
    projector: ProjectorDevice,
    camera: CameraDevice,
    *,
    folder: str | Path,
    exposure_ms: float,
    timing: Timing | None = None,
    clock: Clock | None = None,
    facts: Mapping[str, Setting] | None = None,
    curve: GreyCurve | None = None,
    proof: bool = False,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> Acquisition:
    """Show each image of a sequence, and write the frame that shows it into `folder`.

    Every image is on disk under its final name (`patterns.frame_names`) before the next one is
    shown; ``capture.toml`` comes last. After an interruption at any moment the same call goes on
    where it stopped. Times count from the start of the acquisition; a pause between two runs is
    left out, and `provenance.resumed_at` names the image after it.

    Parameters
    ----------
    sequence
        What to show; its sets' `repeats` and `exposure_ms` are honoured.
    projector, camera
        Of the same `clock` (the machine's, unless given); they stay open.
    folder
        The capture.
    exposure_ms
        Of sets that do not say their own.
    timing
        How long to wait.
    facts
        What else must stay the same when it goes on, such as `Station.facts`; kept as
        provenance.
    curve
        Pre-distorts what is shown; say in `facts` which it is.
    proof
        Whether each image bears a corner code that its frame must show; pixels that see it are
        written as 0.
    overwrite
        Begin anew in a folder that holds a capture, other files, or a part of this one.
    progress
        Wraps the iteration over images.

    Raises
    ------
    DeviceError
        No frame that shows an image came, or a device failed; the message names the image.
    UsageError
        The sequence cannot be shown, the folder holds something else or another process acquires
        into it, or the acquisition that was interrupted there had other settings: the message says
        which.
    FormatError
        A file cannot be written.
    """
    timing, clock = timing or Timing(), clock or MonotonicClock()
    shots = plan_shots(sequence, exposure_ms)
    check_sequence(sequence, projector, shots=shots, timing=timing)
    rendered = render_sequence(sequence, bits=projector.bits, curve=curve)
    settings = _settings(projector, camera, exposure_ms=exposure_ms, timing=timing)
    code = CornerCode(sequence.width, sequence.height) if proof else None
    if code is not None:
        settings["corner_code"] = f"cells of {code.cell_px} px"
    plan = Acquiring(_describe(sequence), {**settings, **(facts or {})})
    # What could not be written in the end is refused before the work.
    describe_capture(sequence, sensor=camera.sensor, provenance=plan.settings)
    names = [shot.name for shot in shots]
    with locked(Path(folder)):
        journal = Journal(Path(folder), plan, names=names, overwrite=overwrite)
        missing = [shot for shot in shots if shot.name not in journal.state.images]
        tally = journal.state.frames
        images, reader = shown_images(missing, rendered), None
        if code is not None and missing:
            code, reader = locate_code(
                projector, camera, clock=clock, timing=timing, exposure_ms=exposure_ms
            )
            images = _stamped(code, missing, images, white=2**projector.bits - 1)
        taker = FrameTaker(projector, camera, clock=clock, timing=timing, tally=tally, proof=reader)
        pairs = zip((progress or no_progress)(missing, "acquiring"), images, strict=True)
        if journal.state.images and missing:
            journal.resume_at(missing[0].name)
        _take_all(pairs, taker, journal=journal, clock=clock)
        text = describe_capture(
            _timed(sequence, journal.state.images),
            sensor=camera.sensor,
            provenance=_provenance(journal.state),
        )
        path = journal.finish(text)
    return Acquisition(path, len(shots), len(missing), journal.state.frames)


def _take_all(
    shots: Iterable[tuple[Shot, Frames]], taker: FrameTaker, *, journal: Journal, clock: Clock
) -> None:
    """Take shots with their images; times go on after the last one of an earlier run."""
    begin_s = clock.now() - max((item.time_s for item in journal.state.images.values()), default=0)
    for shot, image in shots:
        try:
            seen, start_s = taker.take(shot, image)
        except DeviceError:
            journal.count(taker.tally)
            raise
        journal.add(shot.name, seen, time_s=start_s - begin_s, frames=taker.tally)


def plan_shots(sequence: Sequence, exposure_ms: float) -> list[Shot]:
    """Every image of a sequence in its order; those that show one pattern have one corner code."""
    shots: list[Shot] = []
    shown = 0
    for place, (item, row) in enumerate(zip(sequence.sets, frame_names(sequence), strict=True)):
        exposure = item.exposure_ms or exposure_ms
        for index, name in enumerate(row):
            frame = index // item.repeats
            shots.append(Shot(name, place, frame, exposure, shown + frame))
        shown += len(row) // item.repeats
    return shots


def _stamped(
    code: CornerCode, shots: list[Shot], images: Iterator[Frames], *, white: int
) -> Iterator[Frames]:
    for shot, image in zip(shots, images, strict=True):
        yield code.stamp(image, shot.code, white=white)


def check_sequence(
    sequence: Sequence, projector: ProjectorDevice, *, shots: list[Shot], timing: Timing
) -> None:
    """Refuse what cannot be shown, or seen in time, with a UsageError."""
    shown, own = f"{sequence.width}x{sequence.height}", f"{projector.width}x{projector.height}"
    if shown != own:
        raise UsageError(f"sequence must be of the projector's size, {own} px, got {shown} px")
    # The frame under way when an image has settled is waited for, and one more.
    least_s = 2 * max((shot.exposure_ms for shot in shots), default=0.0) / 1000
    if timing.timeout_s <= least_s:
        raise UsageError(
            f"timeout_s must be above {least_s:g}, two exposures, got {timing.timeout_s:g}"
        )


def shown_images(
    shots: list[Shot], rendered: Iterator[tuple[PatternSet, Frames]]
) -> Iterator[Frames]:
    """What each of the shots shows, one set in memory at a time."""
    for place, (item, stack) in enumerate(rendered):
        for shot in shots:
            if shot.place == place:
                yield stack[shot.frame * item.repeats]


def _settings(
    projector: ProjectorDevice, camera: CameraDevice, *, exposure_ms: float, timing: Timing
) -> dict[str, Setting]:
    """What the images depend on; how long to wait for them may change."""
    dropping = {"drop_frames": timing.drop_frames} if timing.drop_frames else {}
    return {
        "projector": f"{projector.name}: {_size(projector)}, {projector.bits} bit",
        "camera": f"{camera.name}: {_size(camera)}, full scale {camera.sensor.full_scale:g}",
        "exposure_ms": exposure_ms,
        "settle_ms": timing.settle_ms,
        **dropping,
    }


def _size(device: ProjectorDevice | CameraDevice) -> str:
    return f"{device.width}x{device.height} px"


def _describe(sequence: Sequence) -> str:
    untimed = tuple(replace(item, timestamps_s=None) for item in sequence.sets)
    return describe_capture(replace(sequence, sets=untimed))


def _timed(sequence: Sequence, images: Mapping[str, Taken]) -> Sequence:
    """The sequence with the times at which its images were exposed."""
    names = frame_names(sequence)
    times = [tuple(float(np.round(images[name].time_s, 6)) for name in row) for row in names]
    sets = zip(sequence.sets, times, strict=True)
    return replace(sequence, sets=tuple(replace(item, timestamps_s=row) for item, row in sets))


def _provenance(state: Acquiring) -> dict[str, object]:
    resumed = {"resumed_at": list(state.resumed_at)} if state.resumed_at else {}
    return {
        "acquired": f"fringeworks {__version__}",
        **state.settings,
        "frames": asdict(state.frames),
        **resumed,
    }
