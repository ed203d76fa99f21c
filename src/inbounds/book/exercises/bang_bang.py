"""Grader of the page *Every action at its bound* (`judging` tells how one works)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from inbounds.book.exercises.judging import Case, Judgement, judge_cases


def snap(function: Callable[..., Any]) -> Judgement:
    """Each component moved to the nearer of its bounds."""

    def case(action: Sequence[float], low: Sequence[float], high: Sequence[float]) -> Case:
        a, lower, upper = (np.array(x, np.float64) for x in (action, low, high))
        nearer = np.where(np.abs(a - lower) < np.abs(upper - a), lower, upper)
        mistakes = {
            "a component in the middle goes to the upper bound": np.where(
                np.abs(a - lower) <= np.abs(upper - a), lower, upper
            ),
            "the sign decides for symmetric boxes only: compare with the middle of the box": np.where(
                a < 0, lower, upper
            ),
            "that is the farther bound": np.where(nearer == lower, upper, lower),
            "those are signs: the bounds are low and high": np.sign(nearer - (lower + upper) / 2),
            "that is the clip, which leaves the inside as it is": np.clip(a, lower, upper),
        }
        return Case((a, lower, upper), nearer, mistakes)

    cases = [
        case([0.2, -0.7], [-1.0, -1.0], [1.0, 1.0]),
        case([0.1, -0.3], [-0.4, -0.4], [0.4, 0.4]),
        case([1.0, 3.5, 0.1], [0.0, 0.0, -4.0], [10.0, 4.0, 1.0]),
        case([2.0, 0.0], [0.0, -1.0], [4.0, 1.0]),
    ]
    return judge_cases(function, cases, "right, on every box")
