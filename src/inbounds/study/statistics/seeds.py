"""Which seeds count: a missing or diverged seed is NaN, and is refused or left out with a mark."""

from __future__ import annotations

from typing import Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats: TypeAlias = NDArray[np.float64]
Missing: TypeAlias = Literal["raise", "exclude"]


class MissingSeedError(ValueError):
    """A seed has no score, and nobody said what to do about it."""


def finite_seeds(values: ArrayLike, missing: Missing = "raise", at_least: int = 2) -> tuple[Floats, int]:
    """Return the seeds whose numbers are all finite, and how many others there were.

    A seed stays or goes as a whole: were a diverged seed dropped from one epoch on, a learning curve would change
    its population in the middle.

    Args:
        values: `[S, ...]`; NaN or ±inf anywhere marks the seed as missing.
        missing: "raise" refuses such a seed, "exclude" leaves it out.
        at_least: how many seeds must remain.

    Returns:
        `[n, ...]` the seeds that count, in their order, and S − n.

    Raises:
        MissingSeedError: a seed is missing and `missing` is "raise".
        ValueError: no seed axis, too few seeds left, or another `missing`.

    Example:
        >>> finite_seeds([1.0, float("nan"), 3.0], missing="exclude")
        (array([1., 3.]), 1)
    """
    scores = np.asarray(values, dtype=np.float64)
    if missing not in get_args(Missing):
        raise ValueError(f"missing must be one of {', '.join(get_args(Missing))}, got {missing!r}")
    if scores.ndim == 0:
        raise ValueError("expected an array with the seeds on its first axis, got a single number")
    there = np.isfinite(scores).all(tuple(range(1, scores.ndim)))  # [S]
    if missing == "raise" and not there.all():
        raise MissingSeedError(
            f"no finite score at seed position {', '.join(map(str, np.flatnonzero(~there)))} of {len(scores)}: "
            'finish or repair those runs, or pass missing="exclude" and report how many are left out'
        )
    if there.sum() < at_least:
        raise ValueError(
            f"{there.sum()} of {len(scores)} seeds have a finite score, at least {at_least} are needed: run more seeds"
        )
    return scores[there], int((~there).sum())


def countable(values: Floats) -> int:
    """Return how many seeds have a finite number.

    Example:
        >>> countable(np.array([1.0, np.nan]))
        1
    """
    return int(np.isfinite(values).sum())
