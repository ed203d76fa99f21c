"""Compiled functions that are kept on disk, and read from there always. Needs numba, the extra `fast`.

Of two compiled things with one name a process calls the one that came first, and they need not round alike, nor even do
the same. A process that has just compiled a function has compiled what it calls, too, each for itself and optimised
apart: in `inbounds.learning.families.logit_normal_kernel` they do round differently. So a function is compiled by
another process, in which what it calls has names that nothing else has.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import inspect
import os
import pickle
import subprocess
import sys
import tempfile
from collections.abc import Callable, Collection
from types import FunctionType, ModuleType
from typing import Any

import numba
from numba.core import config, event
from numba.core.dispatcher import Dispatcher

from inbounds.distributions import quadrature, standard_normal
from inbounds.learning.families import gaussian, gaussian_kernel, logit_normal
from inbounds.learning.networks import kernels, normalizer
from inbounds.learning.networks.kernels import FAST

ALWAYS_CALLED = (kernels, normalizer, gaussian, gaussian_kernel, logit_normal, quadrature, standard_normal)
_TRIES = 3


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
    """Return a function that is compiled on its first call, and kept on disk.

    numba looks whether the function's file has changed, and not those of the functions that it calls: a digest of all
    of them, and of this file, is part of the name under which it is kept. Where neither the package's folder nor the
    user's can be written to, a temporary folder serves until the process ends.

    Args:
        function: of a module, calls functions made by `kernel` only.
        modules: where these come from, beside `ALWAYS_CALLED`.
        fast: fast-math flags.
    """
    sources = [sys.modules[__name__], *ALWAYS_CALLED, *modules]
    digest = hashlib.sha256("".join(map(inspect.getsource, sources)).encode()).hexdigest()
    function = bound_to(function)
    function.__qualname__ = f"{function.__name__}_{digest[:16]}"
    options: Any = {"fastmath": set(fast), "error_model": "numpy", "cache": True}
    try:
        return numba.njit(**options)(function)
    except RuntimeError:
        os.environ["NUMBA_CACHE_DIR"] = config.CACHE_DIR = _for_this_process().name
        return numba.njit(**options)(function)


class ReadFromDisk:
    """A compiled function that this process reads from disk, after another one has put it there if need be.

    Args:
        make: of a module, returns what `kept_on_disk` does.
        names: what it takes.

    Raises:
        ValueError: on a call for whose types nothing is on disk; the other process failed, or wrote to another folder.
    """

    def __init__(self, make: Callable[..., Any], *names: str) -> None:
        self._recipe = make, names
        self._function = make(*names)
        _refuse_to_compile().functions.append(self._function)

    def __call__(self, *given: Any) -> None:
        """Call the function."""
        try:
            self._function(*given)
        except _NotOnDiskError as missing:
            for _ in range(_TRIES):  # two processes that write at once may lose one of two entries
                self._compile_elsewhere(missing.types)
                with contextlib.suppress(_NotOnDiskError):
                    return self._function(*given)
            raise ValueError(
                f"{self._recipe[0].__name__} has been compiled, and is not in {self._function.stats.cache_path}: set "
                "NUMBA_CACHE_DIR to a folder that can be written to before Python starts"
            ) from None

    def _compile_elsewhere(self, types: tuple[Any, ...]) -> None:
        command = f"from {__name__} import compile_as_asked; compile_as_asked()"
        done = subprocess.run(
            [sys.executable, "-c", command],
            input=pickle.dumps((*self._recipe, types)),
            env={**os.environ, "PYTHONPATH": os.pathsep.join(map(str, sys.path))},
            capture_output=True,
            check=False,
        )
        if done.returncode:
            said = done.stderr.decode(errors="replace").strip().splitlines() or ["it said nothing"]
            raise ValueError(
                f"{sys.executable} could not compile {self._recipe[0].__name__} ({said[-1]}): try again, or train with "
                "the engine autograd"
            )


def compile_as_asked() -> None:
    """Compile what a `ReadFromDisk` asks for on standard input, and leave it on disk."""
    make, names, types = pickle.load(sys.stdin.buffer)
    function = make(*names)
    for kernel in _kernels_below(function.py_func):
        kernel.py_func.__qualname__ += f"_of_{function.py_func.__qualname__}"
    function.compile(types)


def _kernels_below(function: Any) -> set[Dispatcher]:
    """Return all kernels that a function calls, or that those call."""
    found: set[Dispatcher] = set()
    todo = [function]
    while todo:
        calling = todo.pop()
        called = (calling.__globals__.get(name) for name in calling.__code__.co_names)
        new = {one for one in called if isinstance(one, Dispatcher)} - found
        found |= new
        todo += [one.py_func for one in new]
    return found


class _NotOnDiskError(Exception):
    """numba is about to compile a function that is to be read."""

    def __init__(self, types: tuple[Any, ...]) -> None:
        super().__init__(types)
        self.types = types


class _Refuse(event.Listener):
    """Interrupts numba where it has not found some function on disk."""

    def __init__(self) -> None:
        self.functions: list[Any] = []

    def on_start(self, event: Any) -> None:
        if any(event.data["dispatcher"] is function for function in self.functions):
            raise _NotOnDiskError(event.data["args"])

    def on_end(self, event: Any) -> None:
        pass


@functools.cache
def _refuse_to_compile() -> _Refuse:
    listener = _Refuse()
    event.register("numba:compile", listener)
    return listener


@functools.cache
def _for_this_process() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="inbounds-compiled-")
