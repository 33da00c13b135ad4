"""The line on a real calibration capture, beside what plain OpenCV was recorded with."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from fringeworks.calibrate import calibrate_captures
from fringeworks.calibrate.record import read_record
from fringeworks.files import data_folder, read_board, read_capture, write_cloud, write_rig
from fringeworks.measure.board import BoardPlane, BoardSpacing
from fringeworks.model import Capture, Cloud, Rig, Target
from fringeworks.model.progress import Progress
from fringeworks.phase.decode import Decoding, decode_phases
from fringeworks.pipeline import cloud_of, measure_board


@dataclass(frozen=True, slots=True)
class RealSet:
    """A real calibration capture with what plain OpenCV makes of it (its README)."""

    folder: str
    camera_rms_px: float
    projector_rms_px: float
    joint_rms_px: float
    baseline_mm: float


REAL_SETS = (
    RealSet("sample/procam-half", 0.179, 0.248, 0.222, 672.4),
    RealSet("real/procam-graycode", 0.333, 0.218, 0.288, 673.5),
)


@dataclass(frozen=True, slots=True)
class ScannedBoard:
    """A pose at every stop of the line."""

    capture: Capture
    decoding: Decoding
    cloud: Cloud
    spacing: BoardSpacing
    plane: BoardPlane


@dataclass(frozen=True, slots=True)
class RealLine:
    """The rig and the boards that were measured with it; the first one's stages are kept."""

    chosen: RealSet
    path: Path
    rig: Rig
    board: Target
    first: ScannedBoard | None
    boards: tuple[tuple[str, BoardSpacing, BoardPlane], ...]


def find_real_set() -> RealSet | None:
    """The first set whose images are here."""
    data = data_folder()
    return next((item for item in REAL_SETS if (data / item.folder).is_dir()), None)


def run_real_line(
    chosen: RealSet, folder: Path, *, quick: bool = False, progress: Progress
) -> RealLine:
    """Calibrate from all poses, scan each (`quick`: the first) and measure its board.

    The rig and the first pose's cloud are written into `folder`.
    """
    path = data_folder() / chosen.folder
    board = read_board(path / "board.toml")
    poses = sorted(found.parent for found in path.glob("*/capture.toml"))
    captures: Iterator[Capture] = map(read_capture, progress(poses, "calibrating, real capture"))
    rig = calibrate_captures(captures, board)
    write_rig(folder / "rig.json", rig)
    wanted = progress(poses[: 1 if quick else None], "scanning, real capture")
    first, boards = None, []
    for scanned in scan_boards(wanted, rig, board):
        if first is None:
            first = scanned
            write_cloud(folder / "cloud.npz", scanned.cloud)
            write_cloud(folder / "cloud.ply", scanned.cloud)
        boards.append((scanned.capture.name, scanned.spacing, scanned.plane))
    return RealLine(chosen, path, rig, board, first, tuple(boards))


def scan_boards(poses: Iterable[Path], rig: Rig, board: Target) -> Iterator[ScannedBoard]:
    """Each pose that the calibration used, read, decoded, triangulated and measured."""
    for pose in poses:
        capture = read_capture(pose)
        decoding = decode_phases(capture)
        cloud = cloud_of(capture, decoding.projector_map(), rig)
        measured = measure_board(cloud, rig, board, view=capture.name)
        if measured is not None:
            yield ScannedBoard(capture, decoding, cloud, *measured)


@dataclass(frozen=True, slots=True)
class ComparedNumber:
    """A number of the rig over the kept corners and over all, beside plain OpenCV's."""

    name: str
    unit: str
    kept: float
    over_all: float | None
    opencv: float


def compare_rig(line: RealLine) -> tuple[ComparedNumber, ...]:
    """Reprojection errors and baseline beside the recorded ones."""
    record, quality = read_record(line.rig.further), line.rig.quality
    assert record is not None
    assert quality is not None
    camera, projector, joint = record.rms_of_all_px
    chosen = line.chosen
    return (
        ComparedNumber("camera rms", "px", quality.camera_rms_px, camera, chosen.camera_rms_px),
        ComparedNumber(
            "projector rms", "px", quality.projector_rms_px, projector, chosen.projector_rms_px
        ),
        ComparedNumber("joint rms", "px", quality.joint_rms_px, joint, chosen.joint_rms_px),
        ComparedNumber("baseline", "mm", line.rig.baseline_mm, None, chosen.baseline_mm),
    )
