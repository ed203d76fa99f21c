"""Graders of the chapter *What happened* (`judging` tells how one works)."""

import itertools
from collections.abc import Callable, Collection
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inbounds.book.exercises.judging import Case, Judgement, judge_cases

Floats = NDArray[np.float64]
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


def scores(function: Callable[..., Any]) -> Judgement:
    """Interquartile means over robots and seeds together, doing nothing at 0 and the highest mean at 1."""
    rng = np.random.default_rng(0)

    def case(policies: int, robots: int, seeds: int, hint: str) -> Case:
        idle = rng.uniform(50, 200, robots)
        gain = rng.uniform(20, 900, robots) * rng.uniform(0.2, 1, (policies, robots))
        final = idle[:, None] + gain[..., None] * rng.uniform(0.5, 1.5, (policies, robots, seeds))
        best = final.mean(2).max(0)
        mean = ((final - idle[:, None]) / (best - idle)[:, None]).mean((1, 2))
        mistakes = {"that is the mean of all runs: leave out the lowest and the highest quarter": mean}
        for count in range(1, len(BUGS) + 1):
            for left in itertools.combinations(BUGS, count):
                mistakes["; ".join(BUGS[bug] for bug in left)] = _scores(final, idle, left)
        return Case((final, idle), _scores(final, idle), mistakes, hint)

    cases = [
        case(3, 4, 8, "one number per policy, `[C]`: the interquartile mean of all its scaled runs"),
        case(2, 6, 2, "it must hold for any number of policies, robots and seeds"),
    ]
    return judge_cases(
        function,
        cases,
        "right: doing nothing scores 0, the best mean 1, and all runs of a policy count together",
    )


BUGS = {
    "luck": "1 belongs to the highest mean, not to the luckiest run",
    "unit": "the unit is the way from doing nothing to the best, not the best itself",
    "apart": "the middle half is that of all runs of a policy, not of each robot's",
}


def _scores(final: Floats, idle: Floats, bugs: Collection[str] = ()) -> Floats:
    """By the definition, policy by policy, with any of the three bugs."""
    best = np.max(final if "luck" in bugs else final.mean(axis=2, keepdims=True), axis=(0, 2))
    unit = best if "unit" in bugs else best - idle
    found = []
    for policy in final:
        runs = ((policy.T - idle) / unit).T
        groups = runs if "apart" in bugs else [runs.ravel()]
        found.append(np.mean([_middle_half(group) for group in groups]))
    return np.array(found)


def _middle_half(values: Floats) -> float:
    cut = len(values) // 4
    return float(np.sort(values)[cut : len(values) - cut].mean())
