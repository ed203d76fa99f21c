"""Grader of the page *From a symptom to its cause* (`judging` tells how one works)."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inbounds.book.exercises.judging import Case, Judgement, judge_cases
from inbounds.learning.families.policy import SATURATION_MARGIN

__all__ = ["at_bounds"]


def at_bounds(function: Callable[..., Any]) -> Judgement:
    """Shares of executed actions at the lower and at the upper bound, for each dimension: `[2, A]`.

    Args:
        function: the reader's ``at_bounds(action, low, high)``, of arrays `[T, A]`, `[A]` and `[A]`.

    Example:
        >>> at_bounds(lambda action, low, high: np.stack([action <= low, action >= high]).mean(1))
        ✗ not yet: <lambda>: only exact hits are counted: allow a margin of 0.1 % of half the range
    """

    @functools.wraps(function)
    def of(action: NDArray[Any], low: NDArray[Any], high: NDArray[Any]) -> Any:
        return function(action.copy(), low.copy(), high.copy())

    def case(action: NDArray[Any], low: NDArray[Any], high: NDArray[Any]) -> Case:
        margin = SATURATION_MARGIN * (high - low) / 2

        def shares(lower: NDArray[Any], upper: NDArray[Any]) -> NDArray[Any]:
            return np.stack([lower, upper]).mean(1)

        expected = shares(action - low <= margin, high - action <= margin)
        unit = np.abs((action - (low + high) / 2) / ((high - low) / 2)) >= 1 - SATURATION_MARGIN
        mistakes = {
            "only exact hits are counted: allow a margin of 0.1 % of half the range": shares(
                action <= low, action >= high
            ),
            "the margin has no units: 0.001 of *half the range* of each dimension": shares(
                action - low <= SATURATION_MARGIN, high - action <= SATURATION_MARGIN
            ),
            "the margin is a share of the whole range, not of half of it": shares(
                action - low <= 2 * margin, high - action <= 2 * margin
            ),
            "both bounds are in one number: keep them apart, low first": unit.mean(0),
            "upper and lower bound have changed places: low first": expected[::-1],
            "the dimensions are pooled: one share for each": expected.mean(1),
            "that is a test for a box of [−1, 1]: this one has its own bounds": shares(
                action <= -1 + SATURATION_MARGIN, action >= 1 - SATURATION_MARGIN
            ),
        }
        return Case((action, low, high), expected, mistakes, hint="some share is wrong")

    rng = np.random.default_rng(0)
    low, high = np.array([-2.0, 0.0]), np.array([8.0, 1.0])
    clipped = np.clip(rng.normal([3, 0.2], [6, 0.5], (400, 2)), low, high)
    clipped[:40, 0], clipped[40:60, 0] = -1.9965, -1.9935  # inside the margin of 0.005, and a little beyond
    clipped[:30, 1], clipped[30:80, 1] = 0.9996, 0.9993  # likewise, of 0.0005
    wide = np.clip(rng.normal(0, 300, (150, 1)), -500, 200)
    cases = [
        case(clipped, low, high),
        replace(case(wide, np.array([-500.0]), np.array([200.0])), mistakes={}),
    ]
    return judge_cases(of, cases, "right, in any units")
