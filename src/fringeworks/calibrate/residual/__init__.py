"""The residual field of a model: fitted to what it leaves of a calibration's own sites."""
