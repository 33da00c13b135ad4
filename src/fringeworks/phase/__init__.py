"""From a capture to wrapped phase, absolute phase and projector coordinates."""
