"""Environments of the user's own, as Gymnasium names them: module:id, where the module is imported first."""

from __future__ import annotations

import os
import sys


def module_of(env: str) -> str | None:
    """Return the module that an environment's id has imported; None where it has none.

    Example:
        >>> module_of("my_module:Env-v0"), module_of("Hopper-v5")
        ('my_module', None)
    """
    module, colon, _ = env.partition(":")
    return module if colon else None


def find_modules_here() -> None:
    """Have modules in the working directory found, as `python -m` has, but after all others, so that none is hidden."""
    if os.getcwd() not in sys.path and "" not in sys.path:
        sys.path.append(os.getcwd())
