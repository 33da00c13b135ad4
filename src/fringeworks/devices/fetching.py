"""Frames of a driver that tells no times: a thread fetches each at once and notes its arrival."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from threading import Condition, Thread

from fringeworks.devices.protocols import Grab
from fringeworks.errors import DeviceError
from fringeworks.model import Frames

KEPT_FRAMES = 4
"""Frames that wait for somebody to ask; where nobody does the older ones are lost."""

CLOSING_S = 2.0
"""How long the end of a driver that hangs is waited for."""


@dataclass(frozen=True, slots=True, eq=False)
class Arrival:
    """A frame, and when it was there, on the machine's monotonic clock."""

    number: int
    arrived_s: float
    image: Callable[[], Frames]


Fetch = Callable[[float], Arrival | None]
"""Waits some time for the next frame of this exposure, ms; None where there is none yet."""


class FetchingThread:
    """Fetches until it is closed or `fetch` fails; the driver is used by this thread alone.

    Parameters
    ----------
    name
        Of the camera, for its errors.
    fetch
        Sets an exposure that is new to it, and never returns a frame of another one. What it
        raises ends the thread and is told by `grab`.
    release
        Lets go of the driver, at the end.
    exposure_ms
        The first one.
    """

    def __init__(
        self, name: str, fetch: Fetch, *, release: Callable[[], None], exposure_ms: float
    ) -> None:
        self._name, self._fetch, self._release = name, fetch, release
        self._changed = Condition()
        self._wanted_ms = exposure_ms
        self._kept: deque[Arrival] = deque(maxlen=KEPT_FRAMES)
        self._failure: DeviceError | None = None
        self._closing = False
        self._thread = Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def grab(self, *, exposure_ms: float, timeout_s: float) -> Grab:
        """See `CameraDevice`; the exposure is taken to have begun its duration before arrival."""
        with self._changed:
            if exposure_ms != self._wanted_ms:
                self._wanted_ms = exposure_ms
                self._kept.clear()
            if not self._changed.wait_for(self._can_answer, timeout_s):
                raise TimeoutError(f"no frame within {timeout_s:g} s")
            if self._failure is not None:
                raise self._failure
            kept = self._kept.popleft()
        return Grab(kept.number, kept.arrived_s - exposure_ms / 1000, kept.image)

    def close(self) -> None:
        """Stop; a second call does nothing."""
        self._closing = True
        self._thread.join(CLOSING_S)
        self._failure = self._failure or DeviceError(f"{self._name}: was let go of")

    def _can_answer(self) -> bool:
        return bool(self._kept) or self._failure is not None

    def _run(self) -> None:
        try:
            while not self._closing:
                exposure_ms = self._wanted_ms
                self._keep(self._fetch(exposure_ms), exposure_ms)
        except Exception as error:
            self._fail(error)
        finally:
            self._release()

    def _keep(self, arrival: Arrival | None, exposure_ms: float) -> None:
        with self._changed:
            if arrival is not None and exposure_ms == self._wanted_ms:
                self._kept.append(arrival)
                self._changed.notify_all()

    def _fail(self, error: Exception) -> None:
        told = error if isinstance(error, DeviceError) else DeviceError(f"{self._name}: {error}")
        with self._changed:
            self._failure = told
            self._changed.notify_all()
