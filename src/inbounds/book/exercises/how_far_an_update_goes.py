"""Graders of the page *How far an update goes* (`judging` tells how one works)."""

from collections.abc import Callable
from typing import Any

import numpy as np

from inbounds.book.exercises.judging import Case, Judgement, judge_cases


def ratio_of_lengths(function: Callable[..., Any]) -> Judgement:
    """Ratio of the geometric means of two groups of lengths."""
    rng = np.random.default_rng(0)

    def case(first: np.ndarray, second: np.ndarray, hint: str) -> Case:
        right = float(np.prod(first ** (1 / len(first))) / np.prod(second ** (1 / len(second))))
        arithmetic = float(first.mean() / second.mean())
        known = {
            "those are arithmetic means, undone with the wrong base": 10 ** np.log(arithmetic),
            "those are arithmetic means: one long update decides them": arithmetic,
            "natural logarithms are undone by the exponential, not by a power of ten": 10 ** np.log(right),
            "that is the logarithm of the ratio": np.log(right),
            "the second over the first": 1 / right,
        }
        mistakes = {said: float(wrong) for said, wrong in known.items() if not np.isclose(wrong, right)}
        return Case((first, second), right, mistakes, hint, rtol=1e-9)

    cases = [
        case(
            np.array([0.01, 0.1, 1.0]),
            np.array([0.02, 0.02, 0.02]),
            "exp of the difference of mean logarithms",
        ),
        case(10 ** rng.normal(-2, 0.5, 10), 10 ** rng.normal(-1, 0.2, 10), "ten lengths each, far apart"),
    ]
    return judge_cases(function, cases, "geometric means, and one base of logarithms")
