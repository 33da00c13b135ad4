"""The ten parameters fitted to the boards of a calibration, and what planes tell of them."""
