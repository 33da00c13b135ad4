"""The nouns: frozen types, one per stop of the line."""

from fringeworks.model.board import CheckerboardTarget
from fringeworks.model.capture import Capture, Frames, Sensor
from fringeworks.model.cloud import Cloud
from fringeworks.model.finding import Finding
from fringeworks.model.phase import (
    AbsolutePhase,
    CodedAxis,
    FloatMap,
    Noise,
    ProjectorMap,
    Void,
    WrappedPhase,
    describe_voids,
)
from fringeworks.model.progress import Progress, no_progress
from fringeworks.model.rig import Camera, Lens, Pose, Projector, Quality, Rig
from fringeworks.model.sequence import (
    AXES,
    Axis,
    Checkerboard,
    Codeword,
    Colour,
    Fringe,
    GrayCode,
    Pattern,
    PatternSet,
    Picture,
    Sequence,
    Speckle,
    Staircase,
    Uniform,
    gray_bits,
    gray_cells,
    pixel_on_edge,
)

__all__ = [
    "AXES",
    "AbsolutePhase",
    "Axis",
    "Camera",
    "Capture",
    "Checkerboard",
    "CheckerboardTarget",
    "Cloud",
    "CodedAxis",
    "Codeword",
    "Colour",
    "Finding",
    "FloatMap",
    "Frames",
    "Fringe",
    "GrayCode",
    "Lens",
    "Noise",
    "Pattern",
    "PatternSet",
    "Picture",
    "Pose",
    "Progress",
    "Projector",
    "ProjectorMap",
    "Quality",
    "Rig",
    "Sensor",
    "Sequence",
    "Speckle",
    "Staircase",
    "Uniform",
    "Void",
    "WrappedPhase",
    "describe_voids",
    "gray_bits",
    "gray_cells",
    "no_progress",
    "pixel_on_edge",
]
