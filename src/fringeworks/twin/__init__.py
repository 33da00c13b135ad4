"""The digital twin: scene + rig + sequence -> capture, with its truth."""
