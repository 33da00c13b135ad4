"""Captures, boards, rigs, phases, clouds and what the twin is told: `read_x` and `write_x`.

Whatever is wrong with a file is a `FormatError` that names the file and the key, image or array.
Every writer replaces its target only when all of it is written.
"""

from fringeworks.files.board import read_board, write_board
from fringeworks.files.capture import read_capture
from fringeworks.files.capture_writing import write_capture, write_sequence
from fringeworks.files.cloud import read_cloud, write_cloud
from fringeworks.files.data import data_folder, find_data
from fringeworks.files.images import read_image, write_image
from fringeworks.files.phase import read_phase, write_phase
from fringeworks.files.response import read_response, write_response
from fringeworks.files.rig import read_rig, write_rig
from fringeworks.files.scene import read_scene, write_scene
from fringeworks.files.sensor import read_sensor, write_sensor
from fringeworks.files.truth import read_truth, write_truth

__all__ = [
    "data_folder",
    "find_data",
    "read_board",
    "read_capture",
    "read_cloud",
    "read_image",
    "read_phase",
    "read_response",
    "read_rig",
    "read_scene",
    "read_sensor",
    "read_truth",
    "write_board",
    "write_capture",
    "write_cloud",
    "write_image",
    "write_phase",
    "write_response",
    "write_rig",
    "write_scene",
    "write_sensor",
    "write_sequence",
    "write_truth",
]
