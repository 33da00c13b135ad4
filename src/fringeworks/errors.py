"""The exception tree.

A bad pixel is NaN and never an exception. What reaches the user as an exception says what is
wrong, where, and what to do about it.
"""

from __future__ import annotations


class FringeworksError(Exception):
    """Anything this package refuses; `exit_status` is what a command ends with."""

    exit_status = 1


class FormatError(FringeworksError):
    """A file or folder cannot be used: the message names the file and the key or frame."""


class DecodeError(FringeworksError):
    """A whole image set gives no result, for a reason that the message states in pixel shares."""


class CalibrationError(FringeworksError):
    """The captures cannot calibrate a rig: the message names the view and the reason."""


class MeasurementError(FringeworksError):
    """A cloud cannot give the number asked for."""


class DeviceError(FringeworksError):
    """A camera or projector failed: the message names the frame, what was awaited, what to do."""

    exit_status = 3


class ShapeError(FringeworksError, ValueError):
    """A call with arrays that do not fit together."""


class UsageError(FringeworksError, ValueError):
    """A call with values that make no sense, such as a period below two pixels."""

    exit_status = 2


class MissingExtraError(FringeworksError, ImportError):
    """An optional dependency is absent: the message names the extra that brings it."""
