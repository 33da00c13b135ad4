"""The paper on the digital twin, section by section: ``fringeworks reproduce``."""
