"""The graders of *When does the law matter at all?* pass right answers and name the known mistakes."""

from collections.abc import Callable

import numpy as np
import pytest

from inbounds.book.exercises import when_does_the_law_matter as graders


def capped(fraction, cap, *, times=4.0, alpha_beta=None):
    mean = (1 + fraction) / 2
    total = cap / mean if alpha_beta is None else alpha_beta * cap
    return 1 - times * mean * (1 - mean) / (total + 1) / fraction**2


def quiet(scale, rate, steps):
    return np.exp(np.log(scale) - rate * steps)


RIGHT = {"capped_score": capped, "quietest": quiet}


@pytest.mark.parametrize(
    ("grader", "wrong", "words"),
    [
        ("capped_score", lambda f, c: capped(f, c, times=1.0), "four times"),
        ("capped_score", lambda f, c: capped(f, c, alpha_beta=2.0), "both be at the cap"),
        ("capped_score", lambda f, c: (1 - capped(f, c)) * f**2, "that is the variance"),
        ("capped_score", lambda f, c: 1 - (1 - capped(f, c)) * f**2, "divide by"),
        ("quietest", lambda s, r, n: s - r * n, "logarithm"),
        ("quietest", lambda s, r, n: s * np.exp(r * n), "sign"),
        ("quietest", lambda s, r, n: s * np.exp(-r), "one step"),
        ("quietest", lambda s, r, n: np.log(s) - r * n, "log σ"),
    ],
)
def test_known_mistakes_are_named(grader: str, wrong: Callable, words: str) -> None:
    verdict = getattr(graders, grader)(wrong)
    assert verdict.passed is False
    assert words in verdict.message
