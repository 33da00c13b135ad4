"""Gain, read noise, black level and full scale of a camera, from frames that are repeated."""
