"""Verbs that hold devices end by SIGTERM as by Ctrl-C: with devices let go, the projector dark."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NoReturn

from fringeworks.cli.output import print_error

TERMINATED = 128 + signal.SIGTERM


@contextmanager
def stoppable() -> Iterator[None]:
    """Turn SIGTERM into an exit that unwinds; only the main thread can be told."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, _stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _stop(*_: Any) -> NoReturn:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # a second one would stop the letting go
    print_error("terminated", label="")
    raise SystemExit(TERMINATED)
