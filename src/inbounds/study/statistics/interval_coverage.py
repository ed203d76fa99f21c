"""How often an interval contains the truth, and what keeps few seeds from doing so often enough."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from inbounds.study.statistics.seeds import Floats


def coverage_ceiling(n: int) -> float:
    """Return what no interval within the range of n seeds can cover more often, 1 − 2^(1−n), whatever its level.

    The median of a continuous law lies outside the range when all seeds fall on one side of it, either side: with
    probability 2 · 2^(−n). For a symmetric law the median is the mean and the interquartile mean. Every bootstrap
    interval of such a statistic lies within the range.

    Args:
        n: seeds.

    Raises:
        ValueError: no seeds.

    Example:
        >>> [coverage_ceiling(n) for n in (4, 5, 10)]
        [0.875, 0.9375, 0.998046875]
    """
    if n < 1:
        raise ValueError(f"expected at least one seed, got {n}")
    return 1 - 2.0 ** (1 - n)


def coverage(
    interval: Callable[[Floats], tuple[float, float]],
    draw: Callable[[int], ArrayLike],
    truth: float,
    trials: int = 1000,
) -> float:
    """Return how often an interval contains the truth, by simulation (the definition of coverage).

    Its standard error is √(c(1 − c)/trials), 0.7 percentage points at 95 % and 1000 trials.

    Args:
        interval: maps one sample to its interval.
        draw: maps the number of a trial to a sample.
        truth: what the interval should contain.
        trials: how many samples to draw.

    Returns:
        A share in [0, 1].

    Example:
        >>> import numpy as np
        >>> rng = np.random.default_rng(0)
        >>> coverage(lambda x: (x.mean() - 2, x.mean() + 2), lambda _: rng.normal(size=10), truth=0.0, trials=50)
        1.0
    """
    ends = (interval(np.asarray(draw(trial), dtype=np.float64)) for trial in range(trials))
    return float(sum(low <= truth <= high for low, high in ends) / trials)
