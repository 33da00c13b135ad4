"""Scan after scan with a station: measures to a log, clouds to a folder, zones looked at."""

from fringeworks.watch.loop import CLOUDS, LOG, Scanned, Watching, watch
from fringeworks.watch.totals import Totals

__all__ = ["CLOUDS", "LOG", "Scanned", "Totals", "Watching", "watch"]
