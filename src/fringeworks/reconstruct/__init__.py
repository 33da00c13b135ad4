"""From projector coordinates and a rig to a cloud."""
