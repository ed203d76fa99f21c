"""Graders of the page *When does the law matter at all?* (`judging` tells how one works)."""

import math
from collections.abc import Callable
from typing import Any

from scipy import stats

from inbounds.book.exercises.judging import Case, Judgement, judge_cases

__all__ = ["capped_score", "quietest"]


def capped_score(function: Callable[..., Any]) -> Judgement:
    """Judge the score that a Beta's cap leaves."""

    def case(fraction: float, cap: float) -> Case:
        share = (1 + fraction) / 2
        law = stats.beta(cap, cap * (1 - share) / share, loc=-1, scale=2)
        both = 4 * share * (1 - share) / (2 * cap + 1)
        mistakes = {
            "the action lives on an interval of length two: its variance is four times that on [0, 1]": 1
            - law.var() / 4 / fraction**2,
            "α and β cannot both be at the cap unless the mean is in the middle": 1 - both / fraction**2,
            "that is the variance: a score is one minus it, over what doing nothing loses": law.var(),
            "divide by what doing nothing loses, f²": 1 - law.var(),
        }
        return Case((fraction, cap), 1 - law.var() / fraction**2, mistakes)

    return judge_cases(function, [case(0.25, 80.0), case(0.9, 20.0)], "right, wherever the best action lies")


def quietest(function: Callable[..., Any]) -> Judgement:
    """Judge the least σ that Adam reaches."""

    def case(scale: float, learning_rate: float, steps: int) -> Case:
        moved = learning_rate * steps
        mistakes = {
            "σ does not fall by the learning rate: its logarithm does": scale - moved,
            "it falls: the sign of the exponent is wrong": scale * math.exp(moved),
            "that is one step": scale * math.exp(-learning_rate),
            "that is log σ": math.log(scale) - moved,
        }
        return Case((scale, learning_rate, steps), scale / math.exp(moved), mistakes)

    return judge_cases(function, [case(0.42, 3e-4, 1600), case(1.0, 1e-3, 500)], "so quiet, and no quieter")
