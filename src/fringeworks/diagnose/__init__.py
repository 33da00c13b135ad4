"""What is wrong with a capture: one small module per check, findings sorted by what they cost.

A new check is a function that yields `Suspicion`s, a call of it in `capture._suspect`, its name in
`suspicion.FAULTS`, what it imitates in `capture.OUTDONE`, and a maker of its fault in
`experiments.check_faults`.
"""

from fringeworks.diagnose.capture import Diagnosis, Found, check_capture

__all__ = ["Diagnosis", "Found", "check_capture"]
