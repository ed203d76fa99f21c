"""The statistics of the second study's protocol by other means: NumPy, SciPy and the protocol's text."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, stats

Array = NDArray[np.float64]
CHUNK = 10_000  # replicates at a time: what they take stays in the cache


def _chunks(total: int) -> Iterable[int]:
    return (min(CHUNK, total - start) for start in range(0, total, CHUNK))


def counts(rng: np.random.Generator, n: int, resamples: int) -> Array:
    """Draw how often each of n seeds occurs in a resample: `[resamples, n]`."""
    return rng.multinomial(n, np.full(n, 1 / n), size=resamples).astype(float)


def bootstrap_difference(x: Array, y: Array, rng: np.random.Generator, resamples: int) -> Array:
    """Return replicates of the difference of means, each group drawn by itself."""
    return np.concatenate(
        [
            counts(rng, len(x), k) @ x / len(x) - counts(rng, len(y), k) @ y / len(y)
            for k in _chunks(resamples)
        ]
    )


def expanded_share(x: Array, y: Array) -> float:
    """Return the share of replicates left out at each end: Φ(−√(n/(n−1)) · t), Welch's t, n the smaller group."""
    n = min(len(x), len(y))
    freedom = stats.ttest_ind(x, y, equal_var=False).df
    quantile = stats.t.ppf(0.975, freedom if np.isfinite(freedom) else n - 1)
    return float(stats.norm.cdf(-np.sqrt(n / (n - 1)) * quantile))


def welch(x: Array, y: Array) -> Array:
    """Return Welch's |t| along the last axis."""
    error = np.sqrt(x.var(-1, ddof=1) / x.shape[-1] + y.var(-1, ddof=1) / y.shape[-1])
    difference = np.abs(x.mean(-1) - y.mean(-1))
    return np.divide(difference, error, out=np.where(difference > 0, np.inf, 0.0), where=error > 0)


def permutation_p(x: Array, y: Array, rng: np.random.Generator, permutations: int) -> float:
    """Return the studentised permutation test's p: (1 + as extreme as observed) / (1 + permutations)."""
    pooled, observed, extreme = np.concatenate([x, y]), welch(x, y), 0
    for k in _chunks(permutations):
        shuffled = rng.permuted(np.broadcast_to(pooled, (k, len(pooled))), axis=1)
        # The same split, summed in another order, is as extreme as itself.
        extreme += int((welch(shuffled[:, : len(x)], shuffled[:, len(x) :]) >= observed * (1 - 1e-12)).sum())
    return (1 + extreme) / (1 + permutations)


def holm(p: Array) -> Array:
    """Return Holm's adjusted p-values; a missing one (NaN) keeps its place, as if it were 1."""
    order = np.argsort(np.where(np.isnan(p), 1.0, p), kind="stable")
    stepped = np.where(np.isnan(p), 1.0, p)[order] * np.arange(len(p), 0, -1)
    adjusted = np.empty(len(p))
    adjusted[order] = np.minimum(np.maximum.accumulate(stepped), 1)
    return np.where(np.isnan(p), np.nan, adjusted)


def iqm(groups: Sequence[Array], rng: np.random.Generator, resamples: int) -> tuple[float, float, float]:
    """Return the interquartile mean of all runs together, and its percentile interval, robots being strata."""
    replicates = []
    for k in _chunks(resamples):
        drawn = np.concatenate([g[rng.integers(len(g), size=(k, len(g)))] for g in groups], axis=1)
        replicates.append(stats.trim_mean(drawn, 0.25, axis=1))
    low, high = np.quantile(np.concatenate(replicates), [0.025, 0.975])
    return float(stats.trim_mean(np.concatenate(groups), 0.25)), float(low), float(high)


def improvement(
    xs: Sequence[Array], ys: Sequence[Array], rng: np.random.Generator, resamples: int
) -> tuple[float, float, float]:
    """Return the mean over robots of the probability that x's run beats y's, ties by half, and its interval."""
    wins = [(x[:, None] > y) + (x[:, None] == y) / 2 for x, y in zip(xs, ys, strict=True)]
    estimate = float(np.mean([w.mean() for w in wins]))
    if estimate in (0.0, 1.0):
        # Of one robot, that with the fewest seeds: too wide for all six rather than too narrow.
        return estimate, *newcombe(estimate, *min((w.shape for w in wins), key=min))
    replicates = np.zeros(0)
    for k in _chunks(resamples):
        drawn = [
            np.einsum("ri,ri->r", counts(rng, len(w), k) @ w, counts(rng, w.shape[1], k)) / w.size
            for w in wins
        ]
        replicates = np.concatenate([replicates, np.mean(drawn, 0)])
    low, high = np.quantile(replicates, [0.025, 0.975])
    return estimate, float(low), float(high)


def newcombe(estimate: float, m: int, n: int) -> tuple[float, float]:
    """Return Newcombe's (2006, part 2, method 5) score interval of a probability of improvement that is 0 or 1.

    The method's variance of a probability p, of m against n runs with N = (m + n) / 2 − 1, is
    p (1 − p) (1 + N ((1 − p) / (2 − p) + p / (1 + p))) / (m n).
    """

    def beyond(p: float) -> float:
        spread = 1 + ((m + n) / 2 - 1) * ((1 - p) / (2 - p) + p / (1 + p))
        return (estimate - p) ** 2 - stats.norm.ppf(0.975) ** 2 * p * (1 - p) * spread / (m * n)

    end = float(optimize.brentq(beyond, 1e-9, 1 - 1e-9))
    return (end, 1.0) if estimate == 1 else (0.0, end)
