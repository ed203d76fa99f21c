"""The grader of the page on untrained robots passes the right count of seeds and names the known mistakes."""

import math
import statistics
from collections.abc import Callable

import numpy as np
import pytest

from inbounds.book.exercises import six_untrained_robots as graders


def both(first, second):
    return statistics.variance(map(float, first)), statistics.variance(map(float, second))


def counted(first, second, effect):
    """By trial: the first number of seeds whose interval is short enough."""
    a, b = both(first, second)
    return next(float(n) for n in range(1, 10**6) if 1.96 * math.sqrt(a / n + b / n) <= effect)


RIGHT = {"seeds_needed": counted}


def exact(first, second, effect):
    return 1.96**2 * sum(both(first, second)) / effect**2


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (exact, "round up"),
        (lambda *args: math.floor(exact(*args)), "rounded down"),
        (lambda a, b, e: math.ceil(1.96**2 * (np.var(a) + np.var(b)) / e**2), "n − 1"),
        (lambda a, b, e: math.ceil(1.96**2 * np.var(a, ddof=1) / e**2), "both groups"),
        (lambda a, b, e: math.ceil(1.96 * math.sqrt(sum(both(a, b))) / e), "under a root"),
        (lambda a, b, e: math.ceil(sum(both(a, b)) / e**2), "1.96 standard errors"),
        (lambda a, b, e: math.ceil((1.96 * sum(map(math.sqrt, both(a, b))) / e) ** 2), "not the standard"),
        (lambda *_: 12, ""),
    ],
)
def test_known_mistakes_are_named(wrong: Callable, words: str) -> None:
    verdict = graders.seeds_needed(wrong)
    assert verdict.passed is False
    assert words in verdict.message
