"""Grader of *Six robots before they have learned anything* (`judging` tells how one works)."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from inbounds.book.exercises.judging import Case, Judgement, judge_cases


def seeds_needed(function: Callable[..., Any]) -> Judgement:
    """How many seeds a side an interval needs to reach an effect.

    Args:
        function: the reader's ``seeds_needed(first, second, effect)``.

    Example:
        >>> seeds_needed(lambda first, second, effect: ...)
        … not answered: <lambda>: write it, and run this cell again
    """

    def case(first: list[float], second: list[float], effect: float) -> Case:
        a, b = (float(np.var(each, ddof=1)) for each in (first, second))
        exact = 1.96**2 * (a + b) / effect**2
        population = (np.var(first) + np.var(second)) * 1.96**2 / effect**2
        mistakes = {
            "round up: a seed and a half is two seeds": exact,
            "rounded down: the interval would be a little too wide": math.floor(exact),
            "the sample variance divides by n − 1 (ddof=1)": math.ceil(population),
            "both groups scatter: the variances of the two means add": math.ceil(1.96**2 * a / effect**2),
            "squared once too seldom: n stands under a root": math.ceil(1.96 * math.sqrt(a + b) / effect),
            "the interval reaches 1.96 standard errors to either side": math.ceil((a + b) / effect**2),
            "add the variances, not the standard deviations": math.ceil(
                1.96**2 * (math.sqrt(a) + math.sqrt(b)) ** 2 / effect**2
            ),
        }
        return Case((np.array(first), np.array(second), effect), math.ceil(exact), mistakes)

    cases = [
        case([1.0, 4.0, 2.0, 9.0], [3.0, 0.0, 5.0, 1.0, 2.0], 0.7),
        case([-120.0, -90.0, -260.0], [100.0, 40.0, 230.0, 120.0], 33.0),
    ]
    return judge_cases(function, cases, "right, with the variances of both groups")
