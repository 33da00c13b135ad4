"""The only loop that touches hardware: show a pattern, grab a frame that shows it, write it."""

from fringeworks.acquire.journal import count_taken
from fringeworks.acquire.sequence import Acquisition, acquire_sequence
from fringeworks.files.acquiring import Tally
from fringeworks.files.station import Timing

__all__ = ["Acquisition", "Tally", "Timing", "acquire_sequence", "count_taken"]
