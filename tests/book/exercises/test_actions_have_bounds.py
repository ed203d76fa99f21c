"""The grader of the chapter *Actions have bounds*: it names the known mistakes."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy import stats

from inbounds.book.exercises import actions_have_bounds as graders


def outside(loc, scale, low, high):
    return stats.norm.cdf(low, loc, scale) + stats.norm.sf(high, loc, scale)


def stable(loc, scale, low, high):
    return -np.expm1(np.log1p(-outside(loc, scale, low, high)).sum())


RIGHT = {"mass_outside": stable}


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda *a: np.prod(outside(*a)), "every"),
        (lambda *a: np.sum(outside(*a)), "sum over coordinates"),
        (lambda *a: np.prod(1 - outside(*a)), "inside"),
        (lambda m, s, lo, hi: 1 - np.prod(stats.norm.cdf(hi, m, s)), "only the upper"),
        (lambda m, s, lo, hi: 1 - np.prod(stats.norm.sf(lo, m, s)), "only the lower"),
        (outside, "one probability per coordinate"),
        (lambda *a: 1 - np.prod(1 - outside(*a)), "tiny probabilities"),
        (lambda *a: 0.123, "expected"),
    ],
)
def test_known_mistakes_are_named(wrong: Callable, words: str) -> None:
    verdict = graders.mass_outside(wrong)
    assert verdict.passed is False
    assert words in verdict.message
