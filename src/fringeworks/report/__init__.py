"""Figures: every stage of the line as a picture, for the eyes of whoever must trust it.

Modules: `decoding`, `cloud` (with `solid`), `calibration` (with `scene`); `canvas` is what they
share. They import matplotlib, so commands import them only where a figure is asked for.
"""
