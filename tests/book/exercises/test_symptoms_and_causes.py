"""The grader of *From a symptom to its cause* passes right answers, and names the known mistakes."""

from collections.abc import Callable

import numpy as np
import pytest

from inbounds.book.exercises import symptoms_and_causes as graders


def shares(action: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    unit = 2 * (action - low) / (high - low) - 1
    return np.array([(unit <= -0.999).mean(0), (unit >= 0.999).mean(0)])


RIGHT = {"at_bounds": shares}


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda a, lo, hi: np.stack([(a <= lo).mean(0), (a >= hi).mean(0)]), "only exact hits"),
        (lambda a, lo, hi: np.stack([(a <= lo + 1e-3).mean(0), (a >= hi - 1e-3).mean(0)]), "no units"),
        (lambda a, lo, hi: shares(a, lo - 1e-3 * (hi - lo) / 2, hi + 1e-3 * (hi - lo) / 2), "only exact"),
        (lambda a, lo, hi: shares(a, lo, hi).sum(0), "both bounds"),
        (lambda a, lo, hi: shares(a, lo, hi)[::-1], "changed places"),
        (lambda a, lo, hi: shares(a, lo, hi).mean(1), "pooled"),
        (lambda a, lo, hi: shares(a, -np.ones(1), np.ones(1)), "a box of [−1, 1]"),
        (lambda a, lo, hi: shares(a, lo, hi).T, "some share"),
    ],
)
def test_mistakes_in_saturation_are_named(wrong: Callable, words: str) -> None:
    verdict = graders.at_bounds(wrong)
    assert verdict.passed is False
    assert words in verdict.message
