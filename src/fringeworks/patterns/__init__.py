"""Describe a sequence; render it.

`make_sequence` describes what a projector shows, `render_sequence` turns the description into
images, `frame_names` says what to call them.
"""

from fringeworks.model.sequence import fringe_orders
from fringeworks.patterns.checks import check_coding, check_pattern, check_sequence, has_carrier
from fringeworks.patterns.explain import explain_preset, explain_steps
from fringeworks.patterns.exposures import expose_repeatedly
from fringeworks.patterns.names import frame_names
from fringeworks.patterns.presets import (
    PRESETS,
    Code,
    Preset,
    Recipe,
    equal_shifts,
    frequency_ladder,
    make_sequence,
    paired_shifts,
)
from fringeworks.patterns.probe import probe_sequence
from fringeworks.patterns.render import render, render_sequence

__all__ = [
    "PRESETS",
    "Code",
    "Preset",
    "Recipe",
    "check_coding",
    "check_pattern",
    "check_sequence",
    "equal_shifts",
    "explain_preset",
    "explain_steps",
    "expose_repeatedly",
    "frame_names",
    "frequency_ladder",
    "fringe_orders",
    "has_carrier",
    "make_sequence",
    "paired_shifts",
    "probe_sequence",
    "render",
    "render_sequence",
]
