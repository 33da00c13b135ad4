"""Lens, pose, rays and forms on plain arrays."""
