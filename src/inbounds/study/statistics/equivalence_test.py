"""Are two policies as good as each other? Two one-sided tests against a margin that was fixed beforehand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from inbounds.study.statistics.comparisons import ratio, two_groups, welch
from inbounds.study.statistics.seeds import Missing
from inbounds.study.statistics.settings import SIGNIFICANCE


@dataclass(frozen=True)
class Equivalence:
    """Outcome of two one-sided tests.

    Made by `equivalence`, which has an example.
    """

    difference: float
    """Difference of the means."""
    low: float
    """Lower end of its interval with coverage 1 − 2 · level."""
    high: float
    """Upper end; equivalence is this interval inside ± margin."""
    p_value: float
    """The larger of the two one-sided p-values."""
    equivalent: bool
    """Whether it is below the level."""


def equivalence(
    first: ArrayLike,
    second: ArrayLike,
    margin: float,
    *,
    level: float = SIGNIFICANCE,
    paired: bool = False,
    missing: Missing = "raise",
) -> Equivalence:
    """Test whether two means differ by less than a margin: two one-sided t-tests (Schuirmann 1987).

    Not finding a difference is no evidence of there being none; this is. Independent groups may have unequal
    variances (Welch 1947).

    Args:
        first: `[S]` one score per seed.
        second: `[S']`.
        margin: the largest difference that does not matter, in units of the score, fixed beforehand.
        level: of each test.
        paired: whether the design pairs the seeds.
        missing: as in `difference`.

    Returns:
        Difference, interval, p-value, verdict.

    Raises:
        MissingSeedError: a seed is missing and `missing` is "raise".
        ValueError: a margin that is not positive, a level outside (0, ½), or as `difference` raises.

    Example:
        >>> outcome = equivalence([100, 102, 98, 101], [99, 101, 100, 102], margin=5)
        >>> outcome.equivalent, round(outcome.difference, 2)
        (True, -0.25)
    """
    if not (margin > 0 and np.isfinite(margin)) or not 0 < level < 0.5:
        raise ValueError(f"margin must be positive and level in (0, ½), got {margin} and {level}")
    a, b, _ = two_groups(first, second, paired, missing)
    shift = float(a.mean() - b.mean())
    if paired:
        error, freedom = float((a - b).std(ddof=1) / np.sqrt(len(a))), float(len(a) - 1)
    else:
        error, freedom = welch(a, b)
    t = ratio(np.array([shift + margin, margin - shift]), np.array([error, error]))
    p_value = float(stats.t.sf(t, freedom).max())
    reach = float(stats.t.isf(level, freedom)) * error
    return Equivalence(shift, shift - reach, shift + reach, p_value, p_value < level)
