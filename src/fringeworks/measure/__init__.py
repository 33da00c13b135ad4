"""From a cloud to numbers."""
