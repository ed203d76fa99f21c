"""The checks that the configurations share."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from numbers import Integral, Real
from typing import Any

import numpy as np

_MAY_BE_INFINITE = ("max_grad_norm", "clip_range")  # then nothing is clipped


def check(
    config: Any,
    *,
    positive: Sequence[str] = (),
    not_negative: Sequence[str] = (),
    unit: Sequence[str] = (),
    positive_or_none: Sequence[str] = (),
    finite: Sequence[str] = (),
) -> None:
    """Raise a ValueError that names the first field out of range, or the first of another type.

    Args:
        config: a dataclass.
        positive: names of fields that must be > 0; finite, as the others, but for `max_grad_norm` and `clip_range`.
        not_negative: of fields that must be ≥ 0.
        unit: of fields that must lie in [0, 1].
        positive_or_none: of fields that must be > 0, or None.
        finite: of fields that may have any sign.

    Example:
        >>> from types import SimpleNamespace
        >>> check(SimpleNamespace(gamma=1.5), unit=["gamma"])
        Traceback (most recent call last):
        ValueError: gamma must lie in [0, 1], got 1.5
    """
    for field in dataclasses.fields(config) if dataclasses.is_dataclass(config) else ():
        value = getattr(config, field.name)
        if field.type == "int" and (isinstance(value, bool) or not isinstance(value, Integral)):
            raise ValueError(f"{field.name} must be a whole number, got {value!r}")
        if field.type == "bool" and not isinstance(value, bool | np.bool_):
            raise ValueError(f"{field.name} must be True or False, got {value!r}")
    rules = (
        (positive, "be positive", lambda x: x > 0),
        (not_negative, "not be negative", lambda x: x >= 0),
        (unit, "lie in [0, 1]", lambda x: 0 <= x <= 1),
        (positive_or_none, "be positive, or None", lambda x: x is None or x > 0),
        (finite, "be a finite number", math.isfinite),
    )
    for names, rule, holds in rules:
        for name in names:
            value = getattr(config, name)
            may_be_none = names is positive_or_none and value is None
            if not may_be_none and not isinstance(value, Real):  # YAML reads 3e-4, without a dot, as a word
                raise ValueError(f"{name} must be a number, got {value!r}")
            if not holds(value):
                raise ValueError(f"{name} must {rule}, got {value}")
            if name not in _MAY_BE_INFINITE and value == math.inf:
                raise ValueError(f"{name} must be finite, got {value}")


def check_minibatches(horizon: int, minibatch_size: int, normalized: int | None = None) -> None:
    """Raise a ValueError unless minibatches divide the rollout without a rest.

    Args:
        horizon: env steps of the rollout, T.
        minibatch_size: env steps of a minibatch, B.
        normalized: number of advantages that are normalised together; None where they are not.

    Example:
        >>> check_minibatches(100, 64)
        Traceback (most recent call last):
        ValueError: minibatch_size must divide horizon, but 100 = 1 × 64 + 36; 50 would
    """
    quotient, rest = divmod(horizon, minibatch_size)
    if rest:
        divisor = next(size for size in range(min(minibatch_size, horizon), 0, -1) if horizon % size == 0)
        raise ValueError(
            f"minibatch_size must divide horizon, but {horizon} = {quotient} × {minibatch_size} + {rest}; "
            f"{divisor} would"
        )
    if normalized == 1:
        raise ValueError(
            "one advantage has no standard deviation to divide it by: make horizon and minibatch_size larger than 1, "
            "or set normalize_advantage=False"
        )
