"""Grader of the chapter *Actions have bounds* (`judging` tells how one works)."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from scipy import stats

from inbounds.book.exercises.judging import Case, Judgement, judge_cases

__all__ = ["mass_outside"]


def mass_outside(function: Callable[..., Any]) -> Judgement:
    """Judge the probability that some coordinate of a Gaussian action leaves its box."""

    def case(loc: Any, scale: Any, low: Any, high: Any) -> Case:
        loc, scale, low, high = (np.asarray(x, dtype=np.float64) for x in (loc, scale, low, high))
        lower, upper = stats.norm.cdf(low, loc, scale), stats.norm.sf(high, loc, scale)
        expected = -math.expm1(np.log1p(-(lower + upper)).sum())
        mistakes = {
            "that is the probability of leaving the box in *every* coordinate": np.prod(lower + upper),
            "that is the sum over coordinates, an upper bound: they are not disjoint": np.sum(lower + upper),
            "that is the probability of being *inside*": np.prod(1 - lower - upper),
            "only the upper side is counted": 1 - np.prod(1 - upper),
            "only the lower side is counted": 1 - np.prod(1 - lower),
            "one probability per coordinate: combine them into one for the action": lower + upper,
        }
        return Case((loc, scale, low, high), expected, mistakes)

    cancelled = "tiny probabilities cancel: avoid 1 − (number near 1)"
    cases = [
        case([0.3, -0.2], [1.0, 0.5], [-1.0, -1.0], [1.0, 0.4]),
        case([0.0, 0.0, 1.0], [2.0, 0.1, 1.0], [-1.0, -1.0, 0.0], [1.0, 1.0, 3.0]),
        replace(case([0.0, 0.0], [0.1, 0.1], [-1.0, -1.0], [1.0, 1.0]), mistakes={}, hint=cancelled),
    ]
    return judge_cases(function, cases, "right, down to the smallest probabilities")
