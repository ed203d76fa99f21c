"""Over all environments at once: IQM, probability of improvement, performance profiles (Agarwal et al. 2021).

Scores come per environment, normalised (`endpoints.normalize_scores`) except for the probability of improvement, which
is a matter of rank. Each environment has the same weight, however many of its seeds count. Resampling is stratified:
seeds are drawn within each environment, and the environments themselves are fixed. An interval says what other seeds
would have given, nothing about other robots.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats
from scipy.optimize import brentq

from inbounds.study.statistics.intervals import (
    SPOKEN,
    Estimate,
    StatisticName,
    check_bootstrap,
    interquartile_mean,
    limits,
    statistic_named,
)
from inbounds.study.statistics.seeds import Floats, Missing, finite_seeds
from inbounds.study.statistics.settings import LEVEL, PROFILE_RESAMPLES, RESAMPLES


def _strata(scores: Mapping[str, ArrayLike], missing: Missing) -> tuple[dict[str, Floats], int]:
    """Return per environment the scores that count, and how many do not."""
    if not scores:
        raise ValueError("no environments: pass a mapping from environment to scores [S]")
    kept, lost = {}, 0
    for name, values in scores.items():
        if np.ndim(values) != 1:
            raise ValueError(f"{name}: expected one score per seed [S], got shape {np.shape(values)}")
        try:
            kept[name], left_out = finite_seeds(values, missing)
        except ValueError as error:
            raise type(error)(f"{name}: {error}") from None
        lost += left_out
    return kept, lost


def _shares(n: int, resamples: int, rng: np.random.Generator) -> Floats:
    """Return how often each seed is drawn in each resample, over n: `[R, n]`, rows that sum to one."""
    return rng.multinomial(n, np.full(n, 1 / n), size=resamples) / n


def _percentiles(replicates: Floats, level: float) -> tuple[Floats, Floats]:
    """Return the plain percentile interval, which Agarwal et al. use: the pooled seeds are many."""
    return limits(replicates, level, "percentile", n=2, freedom=1)


def aggregate(
    scores: Mapping[str, ArrayLike],
    rng: np.random.Generator,
    *,
    statistic: StatisticName = "iqm",
    level: float = LEVEL,
    resamples: int = RESAMPLES,
    missing: Missing = "raise",
) -> Estimate:
    """Estimate the IQM (or the mean) of normalised scores over all runs, with a stratified bootstrap interval.

    Agarwal et al. (2021, sections 4.1 and 4.3). The middle half is that of all runs together: an environment on which
    every seed does very well or very badly may fall outside it.

    Args:
        scores: per environment the normalised scores `[S]`.
        rng: source of the resamples.
        statistic: "iqm" or "mean".
        level: nominal coverage.
        resamples: number of replicates.
        missing: what to do about a missing seed. Leave no environment out: the aggregate would be of other tasks.

    Returns:
        The estimate; `n` is the smallest number of seeds in an environment.

    Raises:
        MissingSeedError: a seed is missing and `missing` is "raise".
        ValueError: no environments, fewer than two seeds in one, or a senseless setting.

    Example:
        >>> import numpy as np
        >>> scores = {"Hopper-v5": [0.2, 0.4, 0.6, 0.8], "Ant-v5": [0.1, 0.5, 0.5, 0.9]}
        >>> print(f"{aggregate(scores, np.random.default_rng(0)).value:.2f}")
        0.50
    """
    check_bootstrap(level, resamples, "percentile")
    statistic_named(statistic)
    kept, lost = _strata(scores, missing)
    weight = np.concatenate([np.full(len(x), 1 / len(x)) for x in kept.values()])
    shares = np.concatenate([_shares(len(x), resamples, rng) for x in kept.values()], -1)  # [R, N]
    pooled = np.concatenate(list(kept.values()))  # [N]
    if statistic == "mean":
        replicates, value = shares @ pooled / len(kept), weight @ pooled / len(kept)
    else:
        replicates = interquartile_mean(pooled, shares)
        value = interquartile_mean(pooled, weight)
    low, high = _percentiles(replicates, level)
    return Estimate(value, low, high, min(map(len, kept.values())), lost, level, SPOKEN[statistic])


def probability_of_improvement(
    first: Mapping[str, ArrayLike],
    second: Mapping[str, ArrayLike],
    rng: np.random.Generator,
    *,
    level: float = LEVEL,
    resamples: int = RESAMPLES,
    missing: Missing = "raise",
) -> Estimate:
    """Estimate P(first > second) + ½ P(first = second) for a random run of each, averaged over environments.

    Agarwal et al. (2021, section 4.3), with their stratified bootstrap interval. For one environment it is the
    Mann–Whitney U over the number of pairs, and its interval is the score interval that Newcombe (2006, part 2)
    recommends, which stays honest near 0 and 1: where one policy wins every comparison, a bootstrap has nothing to
    resample and its interval no width. Where every one of several environments is decided, all one way, Newcombe's
    interval for one of them (the one with the fewest seeds) is given, which is too wide rather than too narrow. Where
    they are decided, but not all one way, the distances of Newcombe's limits from the shares are added in quadrature.

    It says how often, not by how much. Over six environments with ten seeds a side the bootstrap interval covers
    94–95 % of Normal policies' probabilities up to 0.92, and 91 % at 0.98 (simulated, 1500 samples each).

    Args:
        first: per environment the scores `[S]`, raw or normalised.
        second: the same environments.
        rng: source of the resamples.
        level: nominal coverage.
        resamples: number of replicates.
        missing: what to do about a missing seed.

    Returns:
        The estimate; `n` is the smallest group.

    Raises:
        MissingSeedError: a seed is missing and `missing` is "raise".
        ValueError: the environments differ, or as `aggregate` raises.

    Example:
        >>> import numpy as np
        >>> always = probability_of_improvement({"Ant-v5": [4, 5, 6]}, {"Ant-v5": [1, 2, 3]}, np.random.default_rng(0))
        >>> always.value.item(), bool(always.low < 0.7)  # three seeds prove little
        (1.0, True)
    """
    check_bootstrap(level, resamples, "percentile")
    if set(first) != set(second):
        odd = ", ".join(sorted(set(first) ^ set(second)))
        raise ValueError(f"only one policy has scores on {odd}: compare on the environments of both")
    (a, lost_a), (b, lost_b) = _strata(first, missing), _strata(second, missing)
    values, replicates = [], []
    for name in a:
        gap = a[name][:, None] - b[name]
        wins = (gap > 0) + 0.5 * (gap == 0)  # [S, S']
        drawn = (_shares(len(x[name]), resamples, rng) for x in (a, b))
        replicates.append(np.einsum("ri,ij,rj->r", next(drawn), wins, next(drawn), optimize=True))
        values.append(wins.mean())
    value = float(np.mean(values))
    few = min(a, key=lambda name: min(len(a[name]), len(b[name])))
    sizes = len(a[few]), len(b[few])
    if len(a) == 1 or value in (0.0, 1.0):
        low, high = map(np.asarray, _newcombe(value, *sizes, level))
    elif all(each in (0.0, 1.0) for each in values):
        ends = [
            _newcombe(float(v), len(a[name]), len(b[name]), level) for name, v in zip(a, values, strict=True)
        ]
        below, above = (
            np.array([abs(v - end[i]) for v, end in zip(values, ends, strict=True)]) for i in (0, 1)
        )
        low = np.asarray(value - np.linalg.norm(below) / len(a))
        high = np.asarray(value + np.linalg.norm(above) / len(a))
    else:
        low, high = _percentiles(np.mean(replicates, 0), level)
    return Estimate(
        np.asarray(value), low, high, min(sizes), lost_a + lost_b, level, "probability of improvement"
    )


def _newcombe(value: float, m: int, n: int, level: float) -> tuple[float, float]:
    """Return Newcombe's score interval: where |value − θ| = z · (standard error if θ were true)."""
    z, extra = stats.norm.isf((1 - level) / 2), (m + n) / 2 - 1

    def excess(theta: float) -> float:
        spread = 1 + extra * (1 - theta) / (2 - theta) + extra * theta / (1 + theta)
        return float((value - theta) ** 2 - z**2 * theta * (1 - theta) * spread / (m * n))

    # At θ = value the difference is zero and the error is not (except at the ends, where a root is the value itself).
    low = 0.0 if value == 0 else brentq(excess, 0.0, value - 1e-12)
    high = 1.0 if value == 1 else brentq(excess, value + 1e-12, 1.0)
    return float(low), float(high)


@dataclass(frozen=True)
class Profile:
    """A performance profile.

    Made by `performance_profile`, which has an example.
    """

    thresholds: Floats
    """`[K]` normalised scores τ."""
    share: Estimate
    """`[K]` share of runs that score more than τ, with a pointwise band."""


def performance_profile(
    scores: Mapping[str, ArrayLike],
    thresholds: ArrayLike,
    rng: np.random.Generator,
    *,
    level: float = LEVEL,
    resamples: int = PROFILE_RESAMPLES,
    missing: Missing = "raise",
) -> Profile:
    """Estimate the share of runs that score more than τ, for every τ: the whole distribution in one curve.

    The score distribution of Agarwal et al. (2021, section 4.2): averaged over environments, with a pointwise
    stratified bootstrap band. A curve that is nowhere below another is a policy that is stochastically better.

    Args:
        scores: per environment the normalised scores `[S]`.
        thresholds: `[K]` values of τ.
        rng: source of the resamples.
        level: nominal coverage at one τ.
        resamples: number of replicates.
        missing: what to do about a missing seed.

    Returns:
        The profile.

    Raises:
        MissingSeedError: a seed is missing and `missing` is "raise".
        ValueError: thresholds that are not a finite `[K]`, or as `aggregate` raises.

    Example:
        >>> import numpy as np
        >>> scores = {"Hopper-v5": [0.2, 0.4, 0.6, 0.8]}
        >>> performance_profile(scores, [0.0, 0.5, 1.0], np.random.default_rng(0)).share.value.tolist()
        [1.0, 0.5, 0.0]
    """
    check_bootstrap(level, resamples, "percentile")
    taus = np.asarray(thresholds, dtype=np.float64)
    if taus.ndim != 1 or not len(taus) or not np.isfinite(taus).all():
        raise ValueError(f"expected finite thresholds [K], got {taus.tolist()}")
    kept, lost = _strata(scores, missing)
    above = {name: (x[:, None] > taus).astype(float) for name, x in kept.items()}  # [n, K]
    replicates = np.mean([_shares(len(x), resamples, rng) @ x for x in above.values()], 0)
    value = np.mean([x.mean(0) for x in above.values()], 0)
    low, high = _percentiles(replicates, level)
    n = min(map(len, kept.values()))
    return Profile(taus, Estimate(value, low, high, n, lost, level, "share of runs"))
