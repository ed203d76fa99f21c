"""Where the engine `compiled` is asked for: it needs numba, which is an extra, and a family with kernels."""

from __future__ import annotations

import importlib
import importlib.util
from typing import Any

from inbounds.learning.families.family import Family

NEEDS = ("numba", "threadpoolctl")


def compiled_engine(family: Family) -> Any:
    """Return the module `inbounds.learning.updates.compiled`, which imports numba.

    Args:
        family: of the policy.

    Raises:
        ValueError: the extra `fast` is not installed, or the family has no kernels.

    Example:
        >>> import dataclasses
        >>> from inbounds.learning import FAMILIES
        >>> compiled_engine(dataclasses.replace(FAMILIES["beta"], name="mine", kernels=None))
        Traceback (most recent call last):
        ValueError: the family mine has no kernels for the engine compiled: train it with the engine autograd
    """
    if family.kernels is None:
        raise ValueError(
            f"the family {family.name} has no kernels for the engine compiled: train it with the engine autograd"
        )
    if missing := [name for name in NEEDS if importlib.util.find_spec(name) is None]:
        raise ValueError(
            f"the engine compiled needs {' and '.join(missing)}, of the extra `fast`: pip install '.[fast]' in the "
            "source tree, or train with the engine autograd"
        )
    return importlib.import_module("inbounds.learning.updates.compiled")
