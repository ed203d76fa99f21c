"""Are two sets of learning curves equivalent? Two one-sided tests on the ratio of the mean areas under them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats
from scipy.optimize import brentq

from inbounds.study import statistics


def area(returns: ArrayLike) -> NDArray[np.float64]:
    """Return the area under learning curves per epoch: the mean over epochs, `[...]`, of `[..., epochs]`.

    Epochs in which no episode ended (NaN) are filled as the study's are (`statistics.carry_forward`). Unlike there, a
    curve that ends in NaN has no area: the run diverged or was cut short, and its last return says nothing of the rest.

    Example:
        >>> area([[np.nan, 1.0, np.nan, 4.0], [1.0, 2.0, 3.0, np.nan]]).tolist()  # of 1, 1, 1 and 4
        [1.75, nan]
    """
    curves = np.array(returns, float)
    curves[np.isnan(curves[..., -1])] = np.nan
    return statistics.area_under_curve(statistics.carry_forward(curves))


@dataclass(frozen=True)
class Equivalence:
    """Outcome of the two one-sided tests of `equivalence`."""

    ratio: float
    """Our mean over the peer's."""
    low: float
    """Lower end of the interval of the ratio, with coverage 1 − 2 · level."""
    high: float
    """Upper end; the tests succeed where the interval lies within the margin."""
    p_value: float
    """The larger of the two one-sided p-values."""
    equivalent: bool
    """Whether it is below the level."""


def seeds_needed(ours: ArrayLike, theirs: ArrayLike, margin: float = 0.15, level: float = 0.05) -> int:
    """Return the seeds a side with which `equivalence` succeeds in 8 of 10 cases, if the true means are equal.

    By the normal approximation n = (v₁² + v₂²) (z₀.₉₅ + z₀.₉₀)² / margin² with the coefficients of variation v of the
    samples: a test that two noisy means agree needs many more seeds than one that they differ widely.

    Example:
        >>> seeds_needed([90, 100, 110], [90, 100, 110]), seeds_needed([60, 100, 140], [60, 100, 140])
        (8, 122)
    """
    samples = np.asarray(ours, float), np.asarray(theirs, float)
    return _seeds(sum((x.std(ddof=1) / x.mean()) ** 2 for x in samples), margin, level)


def seeds_needed_within(ours: ArrayLike, theirs: ArrayLike, margin: float, level: float = 0.05) -> int:
    """Return the same for a margin in the samples' own units, where the difference of the means is tested.

    Example:
        >>> seeds_needed_within([90, 100, 110], [90, 100, 110], margin=15)
        8
    """
    return _seeds(sum(np.var(x, ddof=1) for x in (ours, theirs)), margin, level)


def _seeds(variance: float, margin: float, level: float) -> int:
    return int(np.ceil(variance * (stats.norm.isf(level) + stats.norm.isf(0.1)) ** 2 / margin**2))


def _one_sided(ours: NDArray[np.float64], theirs: NDArray[np.float64], ratio: float) -> tuple[float, float]:
    """Return Welch's t and its degrees of freedom for the hypothesis that our mean is `ratio` times theirs."""
    parts = np.array([ours.var(ddof=1) / len(ours), ratio**2 * theirs.var(ddof=1) / len(theirs)])
    freedom = parts.sum() ** 2 / (parts**2 / [len(ours) - 1, len(theirs) - 1]).sum()
    return float((ours.mean() - ratio * theirs.mean()) / np.sqrt(parts.sum())), float(freedom)


def equivalence(ours: ArrayLike, theirs: ArrayLike, margin: float = 0.15, level: float = 0.05) -> Equivalence:
    """Test whether our mean lies within ± margin of the peer's mean (two one-sided tests, Schuirmann 1987).

    The bounds (1 ± margin) · mean(theirs) are themselves estimated. The hypotheses are therefore put as
    mean(ours) − (1 ± margin) · mean(theirs), linear in both means, with unequal variances (Welch), and the interval of
    the ratio is the set of ratios that no one-sided test rejects.

    Args:
        ours: `[n]`, one number per seed.
        theirs: `[m]`, with a mean above zero.
        margin: relative.
        level: of each test.

    Returns:
        Ratio, interval, p-value, verdict.

    Raises:
        ValueError: fewer than two seeds, a seed without an area, or a peer's mean that is not significantly above
            zero.

    Example:
        >>> outcome = equivalence([100, 102, 98, 101], [99, 101, 100, 102])
        >>> round(outcome.ratio, 3), outcome.equivalent
        (0.998, True)
    """
    a, b = np.asarray(ours, float), np.asarray(theirs, float)
    if min(len(a), len(b)) < 2:
        raise ValueError(f"at least two seeds a side are needed, got {len(a)} and {len(b)}: train more")
    if not (np.isfinite(a).all() and np.isfinite(b).all()):
        raise ValueError(
            "a seed diverged or was cut short, and has no area: train it to the end, or leave it out"
        )
    if not stats.ttest_1samp(b, 0, alternative="greater").pvalue < level:
        raise ValueError(
            f"the peer's mean {b.mean():.4g} is not clearly above zero, and a share of it means nothing: train longer"
        )
    above_low, below_high = _one_sided(a, b, 1 - margin), _one_sided(a, b, 1 + margin)
    p_value = max(stats.t.sf(*above_low), stats.t.cdf(*below_high))
    return Equivalence(
        ratio=float(a.mean() / b.mean()),
        low=_limit(a, b, level, upwards=False),
        high=_limit(a, b, level, upwards=True),
        p_value=float(p_value),
        equivalent=bool(p_value < level),
    )


def _limit(ours: NDArray[np.float64], theirs: NDArray[np.float64], level: float, upwards: bool) -> float:
    """Return the ratio, above or below the estimate, at which the one-sided p-value reaches the level."""
    middle = ours.mean() / theirs.mean()
    sign = 1 if upwards else -1

    def excess(ratio: float) -> float:
        t, freedom = _one_sided(ours, theirs, ratio)
        return float(stats.t.cdf(sign * t, freedom)) - level

    outside = middle + 0.01 * sign
    while excess(outside) > 0:
        outside = middle + 2 * (outside - middle)
        if abs(outside) > 1e6:  # the peer's mean is too close to zero for its noise
            return float(sign * np.inf)
    return float(brentq(excess, middle, outside, xtol=1e-12))
