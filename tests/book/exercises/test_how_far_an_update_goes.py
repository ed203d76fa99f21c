"""The graders of *How far an update goes* pass right answers, and name the known mistakes."""

from collections.abc import Callable

import numpy as np
import pytest

from inbounds.book.exercises import how_far_an_update_goes as graders


def geometric(first: np.ndarray, second: np.ndarray) -> float:
    return float(10 ** (np.log10(first).mean() - np.log10(second).mean()))


@pytest.mark.parametrize(("grader", "right"), [(graders.ratio_of_lengths, geometric)])
def test_right_answers_pass(grader: Callable, right: Callable) -> None:
    assert grader(right).passed is True, grader(right)
    assert grader(lambda *_: ...).passed is None


@pytest.mark.parametrize(
    ("grader", "wrong", "words"),
    [
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
