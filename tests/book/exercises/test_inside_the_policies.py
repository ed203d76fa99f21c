"""The graders of *Why: inside the policies* pass right answers, and name the known mistakes."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from inbounds.book.exercises import inside_the_policies as graders


def sums(episodes: np.ndarray, returns: np.ndarray, steps: int) -> tuple[float, float]:
    earned, everything = np.nansum(episodes * returns), steps * len(episodes)
    return everything / episodes.sum(), earned / everything


def geometric(first: np.ndarray, second: np.ndarray) -> float:
    return float(10 ** (np.log10(first).mean() - np.log10(second).mean()))


def by_epoch(episodes: np.ndarray, returns: np.ndarray, steps: int) -> Any:
    some = episodes > 0
    return (steps / episodes[some]).mean(), (episodes * returns / steps)[some].mean()


@pytest.mark.parametrize(
    ("grader", "right"), [(graders.taken_apart, sums), (graders.ratio_of_lengths, geometric)]
)
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
        (
            graders.ratio_of_lengths,
            lambda a, b: 10 ** (np.log(a.mean()) - np.log(b.mean())),
            "wrong base",
        ),
        (graders.ratio_of_lengths, lambda a, b: a.mean() / b.mean(), "one long update decides"),
        (
            graders.ratio_of_lengths,
            lambda a, b: 10 ** (np.log(a).mean() - np.log(b).mean()),
            "not by a power of ten",
        ),
        (graders.ratio_of_lengths, lambda a, b: geometric(b, a), "the second over the first"),
        (graders.ratio_of_lengths, lambda a, b: np.log(geometric(a, b)), "the logarithm of the ratio"),
        (graders.ratio_of_lengths, lambda a, b: 2 * geometric(a, b), "exp of the difference"),
    ],
)
def test_mistakes_are_named(grader: Callable, wrong: Callable, words: str) -> None:
    verdict = grader(wrong)
    assert verdict.passed is False
    assert words in verdict.message
