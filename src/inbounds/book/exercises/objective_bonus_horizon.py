"""Graders of the page *Objective, bonus, horizon* (`judging` tells how one works)."""

from collections.abc import Callable
from typing import Any

import numpy as np

from inbounds.book.exercises.judging import Case, Judgement, judge_cases


def share_seen(function: Callable[..., Any]) -> Judgement:
    """Discounted sum of T equal rewards, as a share of their plain sum."""

    def case(gamma: float, horizon: int, hint: str) -> Case:
        right = float(np.mean(gamma ** np.arange(horizon)))
        total = right * horizon
        known = {
            "one term too many: T rewards are discounted by γ⁰ to γ^(T−1)": (total + gamma**horizon)
            / horizon,
            "it is a share: divide by the plain sum, T": total,
            "one term too many, and not divided by T": total + gamma**horizon,
            "that is the sum of an episode without end": 1 / (1 - gamma) / horizon,
        }
        mistakes = {said: wrong for said, wrong in known.items() if not np.isclose(wrong, right, rtol=1e-9)}
        return Case((gamma, horizon), right, mistakes, hint, rtol=1e-9)

    cases = [
        case(0.9, 5, "add γ⁰ to γ^(T−1), divide by T"),
        case(0.99, 1000, "add γ⁰ to γ^(T−1), divide by T"),
        case(0.9999, 1000, "add γ⁰ to γ^(T−1), divide by T"),
    ]
    return judge_cases(function, cases, "right: the right number of terms, and a share")
