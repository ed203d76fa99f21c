"""What ten seeds can find, and what stays hidden from them: power by simulation.

Two policies whose scores have one standard deviation and means an *effect* apart, in units of that deviation (Cohen's
d), are compared by Welch's t-test. With ten seeds a side and one test, an effect must be about 1.3 to be found four
times in five; where the smallest of six tests counts (Holm's first step, level/6), about 1.8.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import stats

from inbounds.study.statistics.comparisons import welch_freedom
from inbounds.study.statistics.seeds import Floats
from inbounds.study.statistics.settings import SIGNIFICANCE

Draw = Callable[[np.random.Generator, tuple[int, int]], Floats]


def standard_normal(rng: np.random.Generator, shape: tuple[int, int]) -> Floats:
    """Draw scores from a standard Normal, `[trials, S]`."""
    return rng.standard_normal(shape)


def _needed_effects(
    n: int, rng: np.random.Generator, level: float, tests: int, trials: int, draw: Draw
) -> Floats:
    """Return for each simulated pair of groups the effect from which on the test finds it, `[trials]`.

    Adding an effect to the first group moves the numerator of t and nothing else, so the edge is known at once.
    """
    if n < 2 or trials < 1 or tests < 1 or not 0 < level < 1:
        raise ValueError(
            f"expected n ≥ 2, trials ≥ 1, tests ≥ 1, level in (0, 1); got {n}, {trials}, {tests}, {level}"
        )
    a, b = draw(rng, (trials, n)), draw(rng, (trials, n))
    parts = [each.var(-1, ddof=1) / n for each in (a, b)]
    critical = stats.t.isf(level / tests / 2, welch_freedom(parts, [n, n]))
    return critical * np.sqrt(sum(parts)) - (a.mean(-1) - b.mean(-1))


def power(
    effect: float,
    n: int,
    rng: np.random.Generator,
    *,
    level: float = SIGNIFICANCE,
    tests: int = 1,
    trials: int = 20_000,
    draw: Draw = standard_normal,
) -> float:
    """Return how often a two-sided Welch test (Welch 1947) finds an effect, in its direction, by simulation.

    Args:
        effect: difference of the means in standard deviations, not negative.
        n: seeds a side.
        rng: source of the simulated seeds.
        level: of the test.
        tests: divides the level (Bonferroni, Holm's first step); six for six environments.
        trials: simulated experiments; the standard error is at most 0.5 / √trials.
        draw: `(rng, [trials, n])` → scores with standard deviation one and a common mean; a Normal by default.

    Returns:
        A share in [0, 1].

    Raises:
        ValueError: a negative effect, or a setting that makes no sense.

    Example:
        >>> import numpy as np
        >>> round(power(1.32, n=10, rng=np.random.default_rng(0)), 1)
        0.8
    """
    if not effect >= 0:
        raise ValueError(f"effect is a distance, not negative; got {effect}")
    return float(np.mean(_needed_effects(n, rng, level, tests, trials, draw) < effect))


def smallest_detectable_effect(
    n: int,
    rng: np.random.Generator,
    *,
    chance: float = 0.8,
    level: float = SIGNIFICANCE,
    tests: int = 1,
    trials: int = 20_000,
    draw: Draw = standard_normal,
) -> float:
    """Return the effect that is found with the given chance: what the seeds can resolve.

    Args:
        n: seeds a side.
        rng: source of the simulated seeds.
        chance: the power asked for, in (0, 1).
        level: of the test.
        tests: divides the level, as in `power`.
        trials: simulated experiments.
        draw: as in `power`.

    Returns:
        The effect in standard deviations; 0 where the test finds as much without one.

    Raises:
        ValueError: a chance outside (0, 1), or a setting that makes no sense.

    Example:
        >>> import numpy as np
        >>> round(smallest_detectable_effect(10, np.random.default_rng(0)), 1)
        1.3
    """
    if not 0 < chance < 1:
        raise ValueError(f"chance must be in (0, 1), got {chance}")
    return max(0.0, float(np.quantile(_needed_effects(n, rng, level, tests, trials, draw), chance)))
