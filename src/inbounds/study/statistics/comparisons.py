"""Two policies side by side: differences, permutation tests, Holm's correction.

Seeds of two cells are **independent** groups, even where they carry the same numbers: after a few updates nothing but
the number is shared. Where an arm is paired by design (the same networks, noise and resets up to one factor), say
`paired=True`, and the seeds are matched by position.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from inbounds.study.statistics.interval_coverage import coverage_ceiling
from inbounds.study.statistics.intervals import (
    SPOKEN,
    Estimate,
    Method,
    StatisticName,
    check_bootstrap,
    limits,
    resample,
    statistic_named,
)
from inbounds.study.statistics.seeds import Floats, Missing, finite_seeds
from inbounds.study.statistics.settings import LEVEL, PERMUTATIONS, RESAMPLES

_TIES = 1e-9  # two permutations that are equal on paper may differ by rounding


def two_groups(
    first: ArrayLike, second: ArrayLike, paired: bool, missing: Missing
) -> tuple[Floats, Floats, int]:
    """Return the seeds of both groups that count, and how many (of both groups together) do not."""
    a, b = (np.asarray(x, dtype=np.float64) for x in (first, second))
    if a.ndim != 1 or b.ndim != 1:
        raise ValueError(f"expected one score per seed, [S] and [S'], got shapes {a.shape} and {b.shape}")
    if not paired:
        (a, lost_a), (b, lost_b) = finite_seeds(a, missing), finite_seeds(b, missing)
        return a, b, lost_a + lost_b
    if len(a) != len(b):
        raise ValueError(
            f"pairs need as many seeds on both sides, got {len(a)} and {len(b)}: drop paired=True"
        )
    pairs, lost = finite_seeds(np.stack([a, b], -1), missing)  # one half missing: the pair is
    return pairs[:, 0], pairs[:, 1], 2 * lost


def difference(
    first: ArrayLike,
    second: ArrayLike,
    rng: np.random.Generator,
    *,
    statistic: StatisticName = "iqm",
    paired: bool = False,
    level: float = LEVEL,
    resamples: int = RESAMPLES,
    method: Method = "expanded",
    missing: Missing = "raise",
) -> Estimate:
    """Estimate statistic(first) − statistic(second), with a bootstrap interval.

    Independent groups are resampled each by itself (Efron & Tibshirani 1993, chapter 8), pairs together. The
    expansion for few seeds (Hesterberg 2015) takes Welch's degrees of freedom. With five
    seeds a side or fewer it may fall short; `inbounds.study.statistics.intervals` has the numbers.

    Args:
        first: `[S]` one score per seed.
        second: `[S']`, with `paired` matched to the first by position.
        rng: source of the resamples.
        statistic: "mean" or "iqm".
        paired: whether the design pairs the seeds.
        level: nominal coverage.
        resamples: number of replicates.
        method: "expanded" or "percentile".
        missing: what to do about a seed with a NaN; of a pair, both seeds are left out.

    Returns:
        The estimate; `n` is the smaller group.

    Raises:
        MissingSeedError: a seed is missing and `missing` is "raise".
        ValueError: fewer than two seeds in a group, pairs of unequal number, or a senseless setting.

    Example:
        >>> import numpy as np
        >>> rng = np.random.default_rng(0)
        >>> gain = difference(rng.normal(5, 1, 10), rng.normal(0, 1, 10), rng, statistic="mean")
        >>> bool(2 < gain.low < gain.value < gain.high < 8)
        True
    """
    check_bootstrap(level, resamples, method)
    a, b, lost = two_groups(first, second, paired, missing)
    index_a = rng.integers(len(a), size=(resamples, len(a)))
    index_b = index_a if paired else rng.integers(len(b), size=(resamples, len(b)))
    replicates = resample(a, statistic, index_a) - resample(b, statistic, index_b)
    n = min(len(a), len(b))
    low, high = limits(replicates, level, method, n, n - 1 if paired else welch(a, b)[1])
    function = statistic_named(statistic)
    ceiling = coverage_ceiling(n) if paired and statistic == "mean" else 1.0  # a mean of n differences
    name = f"difference of {SPOKEN[statistic]}s"
    return Estimate(function(a) - function(b), low, high, n, lost, level, name, ceiling=ceiling)


def welch(a: Floats, b: Floats) -> tuple[float, float]:
    """Return the standard error of mean(a) − mean(b) and its degrees of freedom (Welch 1947)."""
    parts = [a.var(ddof=1) / len(a), b.var(ddof=1) / len(b)]
    return float(np.sqrt(sum(parts))), float(welch_freedom(parts, [len(a), len(b)]))


def welch_freedom(parts: Sequence[ArrayLike], sizes: Sequence[int]) -> Floats:
    """Return the degrees of freedom of a sum of independent means `[...]` (Welch 1947).

    Args:
        parts: the estimated variance of each mean, `[...]` each, broadcast together.
        sizes: seeds of each mean. Where no part is positive, their sum less one a mean is returned.

    Example:
        >>> round(float(welch_freedom([0.5, 0.5], [10, 10])), 9), float(welch_freedom([0.5, 0.0], [10, 7]))
        (18.0, 9.0)
        >>> float(welch_freedom([0.0, 0.0], [10, 7]))
        15.0
    """
    variance = np.asarray(sum(np.asarray(part, float) for part in parts))
    squares = sum(np.asarray(part, float) ** 2 / (n - 1) for part, n in zip(parts, sizes, strict=True))
    most = np.full_like(variance, sum(sizes) - len(sizes))
    return np.asarray(np.divide(variance**2, squares, out=most, where=variance > 0))


def permutation_test(
    first: ArrayLike,
    second: ArrayLike,
    rng: np.random.Generator,
    *,
    paired: bool = False,
    permutations: int = PERMUTATIONS,
    missing: Missing = "raise",
) -> float:
    """Return the two-sided p-value of equal means, by permuting the studentised difference.

    Exact if both groups follow one law, and asymptotically right where they differ in more than the mean (Janssen
    1997; Chung & Romano 2013). Ten seeds are not many: with Normal groups of ten, one scattering five times as much as
    the other, it rejects equal means in 6.5 % of all cases at the level 5 %, and in 1.6 % at 5 %/6 (simulated, 30 000
    samples).

    Pairs change sides within the pair. The observed order counts as one permutation, so that the test keeps its level
    however few are drawn (Phipson & Smyth 2010).

    Args:
        first: `[S]` one score per seed.
        second: `[S']`.
        rng: source of the permutations.
        paired: whether the design pairs the seeds.
        permutations: how many to draw.
        missing: as in `difference`.

    Returns:
        p, at least 1 / (permutations + 1).

    Raises:
        MissingSeedError: a seed is missing and `missing` is "raise".
        ValueError: fewer than two seeds in a group, pairs of unequal number, or fewer than one permutation.

    Example:
        >>> import numpy as np
        >>> permutation_test([1, 2, 3, 4], [3, 4, 1, 2], np.random.default_rng(0))  # the same means
        1.0
    """
    if permutations < 1:
        raise ValueError(f"permutations must be positive, got {permutations}")
    a, b, _ = two_groups(first, second, paired, missing)
    if paired:
        signs = rng.choice([-1.0, 1.0], size=(permutations, len(a)))
        drawn, observed = _one_sample_t(signs * (a - b)), _one_sample_t((a - b)[None])[0]
    else:
        pooled = np.concatenate([a, b])
        shuffled = rng.permuted(np.broadcast_to(pooled, (permutations, len(pooled))), axis=1)
        drawn, observed = _two_sample_t(shuffled, len(a)), _two_sample_t(pooled[None], len(a))[0]
    as_extreme = np.abs(drawn) >= np.abs(observed) * (1 - _TIES)
    return float((1 + as_extreme.sum()) / (1 + permutations))


def _one_sample_t(values: Floats) -> Floats:
    return ratio(values.mean(-1), np.sqrt(values.var(-1, ddof=1) / values.shape[-1]))


def _two_sample_t(values: Floats, split: int) -> Floats:
    a, b = values[:, :split], values[:, split:]
    variance = a.var(-1, ddof=1) / a.shape[-1] + b.var(-1, ddof=1) / b.shape[-1]
    return ratio(a.mean(-1) - b.mean(-1), np.sqrt(variance))


def ratio(shift: Floats, error: Floats) -> Floats:
    """Return shift / error; without any scatter, 0 for no shift and infinity for one."""
    certain = np.where(shift == 0, 0.0, np.copysign(np.inf, shift))
    return np.where(error > 0, shift / np.where(error > 0, error, 1.0), certain)


def holm(p_values: ArrayLike) -> Floats:
    """Return p-values adjusted for their number: all of them are right at once (Holm 1979).

    The k-th smallest of m is multiplied by m − k + 1, and none may be smaller than the one before it. Rejecting where
    the result is below α errs anywhere with a probability of at most α, whatever the dependence.

    A test that could not be made (NaN) stays NaN and keeps its place in the count: the family is what was planned,
    not what arrived.

    Args:
        p_values: `[m]`.

    Returns:
        `[m]` in the order given.

    Raises:
        ValueError: not one-dimensional, or outside [0, 1].

    Example:
        >>> holm([0.01, 0.04, 0.03]).round(6).tolist()
        [0.03, 0.06, 0.06]
    """
    p = np.asarray(p_values, dtype=np.float64)
    if p.ndim != 1 or not np.all(np.isnan(p) | ((p >= 0) & (p <= 1))):
        raise ValueError(f"expected p-values [m] in [0, 1], got {p.tolist()}")
    order = np.argsort(p)  # NaN last
    steps = p[order] * np.arange(len(p), 0, -1)
    adjusted = np.empty_like(p)
    adjusted[order] = np.minimum(np.maximum.accumulate(steps), 1.0)
    return adjusted


def holm_at_best(p_values: ArrayLike) -> Floats:
    """Return `holm` as if each test that could not be made (NaN) had come out as clear as can be.

    No p-value of a test that was made can become smaller than this when the others arrive.

    Example:
        >>> from inbounds.study.statistics import holm
        >>> holm([0.02, float("nan")]).tolist(), holm_at_best([0.02, float("nan")]).tolist()
        ([0.04, nan], [0.02, 0.0])
    """
    return holm(np.nan_to_num(np.asarray(p_values, dtype=np.float64), nan=0.0))


@dataclass(frozen=True)
class Comparison:
    """Two policies on one environment; NaN and None where a cell is missing.

    Made by `compare`, which has an example.
    """

    difference: Estimate | None
    """First minus second, or None: a cell is missing."""
    p_value: float
    """Of equal means, by `permutation_test`."""
    p_adjusted: float
    """The same after Holm's correction over the environments."""


def compare(
    first: Mapping[str, ArrayLike],
    second: Mapping[str, ArrayLike],
    rng: np.random.Generator,
    *,
    environments: Iterable[str] | None = None,
    statistic: StatisticName = "iqm",
    paired: bool = False,
    level: float = LEVEL,
    missing: Missing = "raise",
) -> dict[str, Comparison]:
    """Compare two policies environment by environment: difference, p-value, p-value after Holm.

    The intervals hold one at a time; only the adjusted p-values speak for all environments at once.

    Args:
        first: per environment the scores `[S]`.
        second: the same for the other policy.
        rng: source of resamples and permutations; each environment has a child of it.
        environments: the planned ones, in order; by default those of either policy.
        statistic: whose difference is estimated; the test is always about means.
        paired: whether the design pairs the seeds.
        level: nominal coverage of each interval.
        missing: what to do about missing *seeds*. A missing *cell* is marked, and counts in Holm's family.

    Returns:
        Per planned environment its comparison.

    Raises:
        MissingSeedError: a seed is missing and `missing` is "raise".
        ValueError: as `difference` raises.
        TypeError: scores that are not named by environment.

    Example:
        >>> import numpy as np
        >>> rng = np.random.default_rng(0)
        >>> better = {"Hopper-v5": rng.normal(9, 1, 10)}
        >>> worse = {"Hopper-v5": rng.normal(0, 1, 10), "Ant-v5": rng.normal(0, 1, 10)}
        >>> rows = compare(better, worse, rng)
        >>> rows["Hopper-v5"].p_adjusted < 0.01, rows["Ant-v5"].difference
        (True, None)
    """
    for scores in (first, second):
        if not isinstance(scores, Mapping):
            raise TypeError(
                f"expected scores by environment, as {{'Hopper-v5': scores}}, got {type(scores).__name__}: for one "
                "environment alone there are `difference` and `permutation_test`"
            )
    planned = list(environments) if environments is not None else list(dict.fromkeys([*first, *second]))
    rows: list[tuple[Estimate | None, float]] = []
    # A generator each: what comes out for one environment does not depend on which others are there.
    for name, own in zip(planned, rng.spawn(len(planned)), strict=True):
        if name not in first or name not in second:
            rows.append((None, float("nan")))
            continue
        a, b = first[name], second[name]
        estimate = difference(a, b, own, statistic=statistic, paired=paired, level=level, missing=missing)
        rows.append((estimate, permutation_test(a, b, own, paired=paired, missing=missing)))
    adjusted = holm([p for _, p in rows])
    return {
        name: Comparison(estimate, p, float(corrected))
        for name, (estimate, p), corrected in zip(planned, rows, adjusted, strict=True)
    }
