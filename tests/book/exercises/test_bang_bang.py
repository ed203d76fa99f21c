"""The grader of *Every action at its bound* passes the right answer and names the known mistakes."""

from collections.abc import Callable

import numpy as np
import pytest

from inbounds.book.exercises import bang_bang as graders


def by_fraction(action, low, high):
    fraction = (action - low) / (high - low)
    return low + (high - low) * np.floor(fraction + 0.5)


RIGHT = {"snap": by_fraction}


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda a, lo, hi: np.where(a < 0, lo, hi), "symmetric boxes only"),
        (lambda a, lo, hi: np.where(a < (lo + hi) / 2, hi, lo), "farther"),
        (lambda a, lo, hi: np.where(a < (lo + hi) / 2, -1.0, 1.0), "those are signs"),
        (np.clip, "the clip"),
        (lambda a, lo, hi: np.where(a <= (lo + hi) / 2, lo, hi), "in the middle"),
        (lambda a, lo, hi: 0 * a, "expected"),
    ],
)
def test_known_mistakes_are_named(wrong: Callable, words: str) -> None:
    verdict = graders.snap(wrong)
    assert verdict.passed is False
    assert words in verdict.message
