"""Figures and pages: every stage of the line as a picture, for the eyes of whoever must trust it.

Modules: `decoding`, `cloud` (with `solid`), `calibration` (with `scene`), `capture`; `canvas` is
what they share. `page` writes what `blocks` describes as one HTML file, with clouds that can be
turned (`viewer`, with `surface`). They import matplotlib, so commands import them only where a
figure is asked for.
"""
