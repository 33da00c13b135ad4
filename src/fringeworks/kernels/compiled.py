"""How every kernel is compiled: cached on disk, division by zero as in numpy, fused multiply-add.

Kernels run without the GIL, so threads may share the work. Contraction is the only liberty taken
with floating point: NaN keeps its meaning.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba import njit

F = TypeVar("F", bound=Callable[..., Any])


def kernel(function: F) -> F:
    """Compile a module-level function with the flags of this package."""
    return _compiled(function, {})


def inlined(function: F) -> F:
    """Like `kernel`, for scalar functions that loops must inline in order to vectorise."""
    return _compiled(function, {"inline": "always"})


def _compiled(function: F, further: dict[str, Any]) -> F:
    flags: dict[str, Any] = {"error_model": "numpy", "fastmath": {"contract"}, "nogil": True}
    flags |= further
    try:
        return cast(F, njit(cache=True, **flags)(function))
    except RuntimeError:  # neither the package's folder nor the user's cache can be written
        return cast(F, njit(**flags)(function))
