"""Say once that kernels are being compiled: the first run on a machine takes seconds longer.

Numba tells of a compilation only when its cache on disk does not have the kernel.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

MESSAGE = "compiling kernels for this machine, once: a few seconds"


@contextmanager
def announced_compiling(say: Callable[[str], None]) -> Iterator[None]:
    """Watch numba's compilations while the block runs; `say` the first one."""
    from numba.core import event

    class Announcer(event.Listener):
        said = False

        def on_start(self, event: Any) -> None:
            if not self.said:
                self.said = True
                say(MESSAGE)

        def on_end(self, event: Any) -> None:
            pass

    with event.install_listener("numba:compile", Announcer()):
        yield
