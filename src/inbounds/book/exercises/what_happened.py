"""Graders of the chapter *What happened* (`judging` tells how one works)."""

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy import stats

from inbounds.book.exercises.judging import Case, Judgement, judge_cases

LEVEL = 0.05


def score_sheet(function: Callable[..., Any]) -> Judgement:
    """Wins, ties and losses of differences after Holm's correction at five per cent."""

    def case(gaps: list[float], p_values: list[float], hint: str) -> Case:
        right = _holm(gaps, p_values)
        known = {
            "p-values are compared with 5 % as they are: correct them for their number": _plain(
                gaps, p_values, 1
            ),
            "that is Bonferroni's correction: Holm's gets milder step by step": _plain(
                gaps, p_values, len(gaps)
            ),
            "once one is not rejected, no larger p-value is: Holm stops there": _without_stop(gaps, p_values),
            "wins and losses have changed places": right[::-1],
        }
        mistakes = {said: wrong for said, wrong in known.items() if wrong != right}
        return Case((np.array(gaps), np.array(p_values)), right, mistakes, hint)

    cases = [
        case(
            [5, 4, 1],
            [0.001, 0.001, 0.8],
            "(wins, ties, losses): clear ones by their sign, the rest are ties",
        ),
        case([5, 4, -3, 2, 1, 6], [0.002, 0.03, 0.04, 0.6, 0.2, 0.03], "p-values must be corrected"),
        case([5, 4, 3, 2], [0.011, 0.014, 0.02, 0.9], "Holm's steps are m, m − 1, …, 1"),
        case([1, 2, 3, -4], [0.04, 0.001, 0.03, 0.045], "a smaller p-value that fails stops all larger ones"),
    ]
    return judge_cases(
        function, cases, "right: corrected step by step, signs kept, and the first failure stops"
    )


def _counts(gaps: list[float], clear: list[bool]) -> list[int]:
    wins = sum(c and g > 0 for c, g in zip(clear, gaps, strict=True))
    losses = sum(c and g < 0 for c, g in zip(clear, gaps, strict=True))
    return [wins, len(gaps) - wins - losses, losses]


def _plain(gaps: list[float], p_values: list[float], factor: int) -> list[int]:
    return _counts(gaps, [p * factor < LEVEL for p in p_values])


def _holm(gaps: list[float], p_values: list[float]) -> list[int]:
    """By the definition: smallest first, against 5 % over what is left, until one fails."""
    clear = [False] * len(gaps)
    for left, i in zip(range(len(gaps), 0, -1), np.argsort(p_values, kind="stable"), strict=True):
        if p_values[i] * left >= LEVEL:
            break
        clear[i] = True
    return _counts(gaps, clear)


def _without_stop(gaps: list[float], p_values: list[float]) -> list[int]:
    order = list(np.argsort(p_values, kind="stable"))
    return _counts(gaps, [p * (len(gaps) - order.index(i)) < LEVEL for i, p in enumerate(p_values)])


def half_width(function: Callable[..., Any]) -> Judgement:
    """Half the width of Student's 95 % interval of the mean over seeds, at each epoch."""
    rng = np.random.default_rng(0)

    def case(seeds: int, epochs: int, hint: str) -> Case:
        returns = rng.normal(100, 20, (seeds, epochs)) + 50 * rng.normal(size=(seeds, 1))
        right = stats.t.ppf(0.975, seeds - 1) * stats.sem(returns, axis=0)
        normal = 1.96 / stats.t.ppf(0.975, seeds - 1)
        biased, pooled = np.sqrt((seeds - 1) / seeds), np.sqrt(1 / epochs)
        errors = {
            "the quantile is a Normal's, and so few seeds need Student's t": normal,
            "the standard deviation divides by S, not by S − 1": biased,
            "epochs are counted as if they were seeds": pooled,
        }
        mistakes = {said: right * factor for said, factor in errors.items()}
        for said, factor in errors.items():
            rest = normal * biased * pooled / factor
            mistakes[f"two errors are left; this one is mended: {said}"] = right * rest
        mistakes["all three errors are still there"] = right * normal * biased * pooled
        mistakes["that is the interval of a single seed, not of the mean"] = right * np.sqrt(seeds)
        return Case((returns,), right, mistakes, hint, rtol=1e-4)

    cases = [
        case(10, 6, "one number per epoch is expected, `[E]`"),
        case(4, 3, "it must hold for any number of seeds"),
    ]
    return judge_cases(
        function, cases, "right: seeds are the unit, and Student's quantile knows how few they are"
    )
