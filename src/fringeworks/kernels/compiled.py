"""How every kernel is compiled: cached on disk, division by zero as in numpy, fused multiply-add.

Kernels run without the GIL, so threads may share the work. Contraction is the only liberty taken
with floating point, and in `summing` the order of a sum: NaN keeps its meaning.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias, TypeVar, cast

from numba import njit

F = TypeVar("F", bound=Callable[..., Any])
Real: TypeAlias = Any
"""A number of single or of double precision: a scalar kernel is compiled for what it is given."""


def kernel(function: F) -> F:
    """Compile a module-level function with the flags of this package."""
    return _compiled(function, {})


def inlined(function: F) -> F:
    """Like `kernel`, for scalar functions that loops must inline in order to vectorise."""
    return _compiled(function, {"inline": "always"})


def summing(function: F) -> F:
    """Like `kernel`, for sums that may be taken in any order: in the written one they are slow."""
    return _compiled(function, {"fastmath": {"contract", "reassoc"}})


def _compiled(function: F, further: dict[str, Any]) -> F:
    flags: dict[str, Any] = {"error_model": "numpy", "fastmath": {"contract"}, "nogil": True}
    flags |= further
    try:
        return cast(F, njit(cache=True, **flags)(function))
    except RuntimeError:  # neither the package's folder nor the user's cache can be written
        return cast(F, njit(**flags)(function))
