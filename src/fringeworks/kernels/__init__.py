"""Numba loops: arrays in, arrays out."""
