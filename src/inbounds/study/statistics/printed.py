"""Means, their differences and combinations, each with the one interval that it has wherever it is printed.

Every interval here has `MANY_RESAMPLES` replicates, all from one seed. So it is a function of the seeds' scores alone:
two pages that print one mean print one interval, whoever computes it and whatever was computed before.

    mean_of(scores(outcome, "final"))
    minus(scores(first, "final"), scores(second, "final"))
"""

from __future__ import annotations

import functools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from inbounds.study.statistics.comparisons import Comparison, compare, difference, welch_freedom
from inbounds.study.statistics.interval_coverage import coverage_ceiling
from inbounds.study.statistics.intervals import (
    Estimate,
    StatisticName,
    bootstrap,
    check_bootstrap,
    limits,
    resample,
)
from inbounds.study.statistics.seeds import Floats, Missing, finite_seeds
from inbounds.study.statistics.settings import LEVEL, MANY_RESAMPLES

_SEED = 0


def mean_of(values: ArrayLike, *, statistic: StatisticName = "mean", missing: Missing = "raise") -> Estimate:
    """Return the mean over seeds of numbers `[S, ...]`, with its interval.

    Args:
        values: one number per seed; further axes are resampled together.
        statistic: "iqm" for the mean of the middle half.
        missing: what to do about a seed with a NaN.

    Example:
        >>> mean_of([1.0, 2.0, 3.0]).value.item()
        2.0
    """
    rng = np.random.default_rng(_SEED)
    return bootstrap(values, rng, statistic=statistic, resamples=MANY_RESAMPLES, missing=missing)


def minus(first: ArrayLike, second: ArrayLike) -> Estimate:
    """Return the difference of the means of two independent groups of seeds, with its interval.

    The other way round its ends have the other sign. Seeds without a finite number are left out and counted.

    Args:
        first: `[S]`.
        second: `[S']`.

    Example:
        >>> ahead, behind = minus([2.0, 3.0, 4.0], [1.0, 1.0, 4.0]), minus([1.0, 1.0, 4.0], [2.0, 3.0, 4.0])
        >>> ahead.value.item(), bool(ahead.high == -behind.low)
        (1.0, True)
    """
    a, b = (np.asarray(x, np.float64) for x in (first, second))
    of_a, of_b = ((np.nanmean(x), tuple(np.nan_to_num(x, nan=-np.inf))) for x in (a, b))  # NaN has no order
    if of_a < of_b:
        turned = minus(b, a)
        return replace(turned, value=-turned.value, low=-turned.high, high=-turned.low)
    return _minus(tuple(a), tuple(b))


@functools.cache
def _minus(first: tuple[float, ...], second: tuple[float, ...]) -> Estimate:
    rng = np.random.default_rng(_SEED)
    return difference(first, second, rng, statistic="mean", resamples=MANY_RESAMPLES, missing="exclude")


def compared(
    first: Mapping[str, ArrayLike],
    second: Mapping[str, ArrayLike],
    rng: np.random.Generator,
    *,
    environments: Iterable[str] | None = None,
) -> dict[str, Comparison]:
    """Compare the means of two policies by environment: the p-values of `compare`, the intervals of `minus`.

    Args:
        first: per environment the scores `[S]`; seeds without a finite number are left out and counted.
        second: the same for the other policy.
        rng: source of the permutations, as `compare` has it.
        environments: the planned ones, in order; by default those of either policy.

    Example:
        >>> rows = compared({"Ant-v5": [2.0, 3.0, 4.0]}, {"Ant-v5": [1.0, 1.0, 4.0]}, np.random.default_rng(0))
        >>> rows["Ant-v5"].difference == minus([2.0, 3.0, 4.0], [1.0, 1.0, 4.0])
        True
    """
    rows = compare(first, second, rng, environments=environments, statistic="mean", missing="exclude")
    return {
        name: replace(row, difference=minus(first[name], second[name])) if row.difference else row
        for name, row in rows.items()
    }


def combination(groups: Sequence[Floats], weights: Sequence[float]) -> Estimate:
    """Return Σ weight · mean over independent groups of seeds, with its interval.

    Args:
        groups: `[S]` each; seeds without a finite number are left out and counted.
        weights: one per group.

    Returns:
        The estimate, with the degrees of freedom of Welch (1947); for weights 1 and −1 that of `minus`, for a single
        weight of 1 that of `mean_of`.

    Example:
        >>> import numpy as np
        >>> groups = [np.array([1.0, 2.0, 3.0]), np.array([1.0, 1.0, 4.0])]
        >>> combination(groups, [1.0, -0.5]).value.item()
        1.0
    """
    if tuple(weights) == (1, -1):
        return minus(*groups)
    check_bootstrap(LEVEL, MANY_RESAMPLES, "expanded")
    rng = np.random.default_rng(_SEED)
    found = [finite_seeds(group, "exclude") for group in groups]
    kept, lost = [each for each, _ in found], sum(gone for _, gone in found)
    drawn = [resample(x, "mean", rng.integers(len(x), size=(MANY_RESAMPLES, len(x)))) for x in kept]
    replicates = sum(
        (w * each for w, each in zip(weights, drawn, strict=True)), start=np.zeros(MANY_RESAMPLES)
    )
    parts = [w**2 * x.var(ddof=1) / len(x) for w, x in zip(weights, kept, strict=True)]
    sizes = [len(x) for x in kept]
    low, high = limits(replicates, LEVEL, "expanded", min(sizes), welch_freedom(parts, sizes))
    value = np.asarray(sum(w * x.mean() for w, x in zip(weights, kept, strict=True)))
    ceiling = coverage_ceiling(len(kept[0])) if len(kept) == 1 else 1.0
    name = "mean" if len(kept) == 1 else "difference of means"
    return Estimate(value, low, high, min(sizes), lost, LEVEL, name, ceiling=ceiling)
