"""Compiled functions that are kept on disk. Needs numba, the extra `fast`."""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Collection
from types import FunctionType, ModuleType
from typing import Any

import numba

from inbounds.distributions import quadrature
from inbounds.learning.families import gaussian, logit_normal
from inbounds.learning.networks import kernels
from inbounds.learning.networks.kernels import FAST


def bound_to(function: Any, **names: Any) -> Any:
    """Return a copy of a function that finds other things under some names of its module.

    numba reads a function's globals when it compiles. A compiled function that took the kernels of a family as
    arguments could not be kept on disk.

    Example:
        >>> bound_to(inspect.cleandoc, len=lambda text: 0) is inspect.cleandoc
        False
    """
    bound = FunctionType(function.__code__, function.__globals__ | names, function.__name__)
    bound.__module__ = function.__module__
    return bound


def kept_on_disk(function: Any, *modules: ModuleType, fast: Collection[str] = tuple(FAST)) -> Any:
    """Return a function that is compiled on its first call, and kept on disk where there is a place to write to.

    numba looks whether the function's file has changed, and not those of the functions that it calls: a digest of all
    of them is part of the name under which it is kept.

    Args:
        function: of a module, calls functions made by `kernel` only.
        modules: where these come from, beside `networks.kernels`.
        fast: fast-math flags.
    """
    sources = [kernels, gaussian, logit_normal, quadrature, *modules]
    digest = hashlib.sha256("".join(map(inspect.getsource, sources)).encode()).hexdigest()
    function = bound_to(function)
    function.__qualname__ = f"{function.__name__}_{digest[:16]}"
    options: Any = {"fastmath": set(fast), "error_model": "numpy"}
    try:
        return numba.njit(cache=True, **options)(function)
    except RuntimeError:  # neither the package's folder nor the user's can be written to
        return numba.njit(**options)(function)
