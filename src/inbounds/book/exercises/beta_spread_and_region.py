"""Grader of *Which means and which spreads?* (`judging` tells how one works)."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from inbounds.book.exercises.judging import Case, Judgement, judge_cases

NO_POLICY = math.nan
"""What stands for the reader's None, which the judge would take for an exercise not answered."""


def match_moments(function: Callable[..., Any]) -> Judgement:
    """α and β of a Beta policy from its mean and standard deviation; None where no policy has them.

    Args:
        function: the reader's ``match_moments(mean, std, low, high, cap)``.

    Example:
        >>> match_moments(lambda mean, std, low, high, cap: ...)
        … not answered: <lambda>: write it, and run this cell again
    """

    def concentrations(m: float, v: float) -> tuple[float, float]:
        # The fraction's raw moments E[x], E[x²] → α, by E[x²]/E[x] = (α + 1)/(ν + 1).
        second = v / m + m
        alpha = m * (1 - second) / (second - m)
        return alpha, alpha * (1 - m) / m

    def attempt(mean: float, std: float, low: float, high: float, cap: float) -> Any:
        answer = function(mean, std, low, high, cap)
        return NO_POLICY if answer is None else answer

    def possible(mean: float, std: float, low: float, high: float, cap: float = 80.0) -> Case:
        m, v = (mean - low) / (high - low), (std / (high - low)) ** 2
        alpha, beta = concentrations(m, v)
        unscaled = concentrations(m, std**2)
        total = m * (1 - m) / v
        mistakes = {
            "the parameters have changed places: α pulls towards high": (beta, alpha),
            "the standard deviation is in units of the action: divide it by the interval's length": unscaled,
            "the variance is m(1 − m)/(ν + 1), not m(1 − m)/ν": (m * total, (1 - m) * total),
            "that takes the standard deviation for the variance": concentrations(m, std / (high - low)),
            "you refuse a mean and a spread that a policy can have": NO_POLICY,
        }
        return Case((mean, std, low, high, cap), (alpha, beta), mistakes, hint="wrong α or β")

    def refused(mean: float, std: float, low: float, high: float, why: str, cap: float = 80.0) -> Case:
        given = concentrations((mean - low) / (high - low), (std / (high - low)) ** 2)
        return Case((mean, std, low, high, cap), NO_POLICY, {why: given}, hint="this should be None")

    too_wide = "one of the parameters would be below 1 here: return None"
    too_narrow = "one of the parameters would be above the cap here: return None"
    cases = [
        possible(0.2, 0.1, 0.0, 0.5),
        possible(0.3, 0.2, -1.0, 1.0),
        refused(0.9, 0.3, -1.0, 1.0, too_wide),
        refused(-0.9, 0.3, -1.0, 1.0, too_wide),  # the other parameter
        refused(0.0, 0.01, -1.0, 1.0, too_narrow),
        refused(0.8, 0.05, -1.0, 1.0, too_narrow),  # α alone
        refused(-0.8, 0.05, -1.0, 1.0, too_narrow),  # β alone
        refused(0.3, 0.2, -1.0, 1.0, "the cap is an argument: this one is 10", cap=10.0),
        possible(0.0, 0.05, -1.0, 1.0, cap=300.0),
        possible(4.9, 0.09, 0.0, 5.0),
    ]
    attempt.__name__ = getattr(function, "__name__", "match_moments")
    return judge_cases(attempt, cases, "right, and it knows what a Beta policy cannot do")
