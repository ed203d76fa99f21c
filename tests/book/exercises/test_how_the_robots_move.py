"""The graders of *How the robots move* pass right answers, and name the known mistakes."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from inbounds.book.exercises import how_the_robots_move as graders


def sums(episodes: np.ndarray, returns: np.ndarray, steps: int) -> tuple[float, float]:
    earned, everything = np.nansum(episodes * returns), steps * len(episodes)
    return everything / episodes.sum(), earned / everything


def by_epoch(episodes: np.ndarray, returns: np.ndarray, steps: int) -> Any:
    some = episodes > 0
    return (steps / episodes[some]).mean(), (episodes * returns / steps)[some].mean()


@pytest.mark.parametrize(("grader", "right"), [(graders.taken_apart, sums)])
def test_right_answers_pass(grader: Callable, right: Callable) -> None:
    assert grader(right).passed is True, grader(right)
    assert grader(lambda *_: ...).passed is None


@pytest.mark.parametrize(
    ("grader", "wrong", "words"),
    [
        (graders.taken_apart, by_epoch, "add first, divide once"),
        (graders.taken_apart, lambda *a: sums(*a)[::-1], "the other way about"),
        (
            graders.taken_apart,
            lambda e, r, s: (sums(e, r, s)[0], np.nansum(e * r) / e.sum()),
            "not per episode",
        ),
        (graders.taken_apart, lambda e, r, s: sums(e, r, s * 2), "two epochs"),
        (
            graders.taken_apart,
            lambda e, r, s: (sums(e, r, s)[0], (e * r).sum() / (s * len(e))),
            "leave it out of the sum",
        ),
        (
            graders.taken_apart,
            lambda e, r, s: (s / e.sum(), np.nansum(e * r) / s),
            "the steps of all epochs",
        ),
    ],
)
def test_mistakes_are_named(grader: Callable, wrong: Callable, words: str) -> None:
    verdict = grader(wrong)
    assert verdict.passed is False
    assert words in verdict.message
