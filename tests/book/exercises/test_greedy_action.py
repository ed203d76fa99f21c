"""The graders of *The greedy action* pass the right answer, found by other means, and name the known mistakes."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.special import expit

from inbounds.book.exercises import greedy_action as graders


def mean(loc, scale, low, high):
    t = np.linspace(-9, 9, 4001)
    weight = np.exp(-(t**2) / 2)
    return low + (high - low) * np.sum(weight * expit(loc + scale * t)) / weight.sum()


def hermite(loc, scale, low, high, stretch, total):
    nodes, weights = np.polynomial.hermite.hermgauss(100)
    return low + (high - low) * np.sum(weights * expit(loc + stretch * scale * nodes)) / total


RIGHT = {"mean_action": mean}
ROOT2, ROOT_PI = np.sqrt(2), np.sqrt(np.pi)


@pytest.mark.parametrize(
    ("name", "wrong", "words"),
    [
        ("mean_action", lambda m, s, lo, hi: lo + (hi - lo) * expit(m), "median"),
        ("mean_action", lambda *a: hermite(*a, 1.0, 1.0), "both errors"),
        ("mean_action", lambda *a: hermite(*a, 1.0, ROOT_PI), "√2"),
        ("mean_action", lambda *a: hermite(*a, ROOT2, 1.0), "√π"),
        ("mean_action", lambda m, s, lo, hi: mean(m, s, 0.0, 1.0), "box is missing"),
        ("mean_action", lambda m, s, lo, hi: mean(m, s, 0.0, hi - lo), "lower bound"),
        ("mean_action", lambda *a: 0.5, "expected"),
    ],
)
def test_known_mistakes_are_named(name: str, wrong: Callable, words: str) -> None:
    verdict = getattr(graders, name)(wrong)
    assert verdict.passed is False
    assert words in verdict.message
