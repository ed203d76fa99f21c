"""The grader of the horizon passes right answers, and names the known mistakes."""

from collections.abc import Callable

import pytest

from inbounds.book.exercises import objective_bonus_horizon as graders


def geometric(gamma: float, horizon: int) -> float:
    return (1 - gamma**horizon) / (1 - gamma) / horizon


@pytest.mark.parametrize(
    ("grader", "right"),
    [(graders.share_seen, geometric)],
)
def test_right_answers_pass(grader: Callable, right: Callable) -> None:
    assert grader(right).passed is True, grader(right)
    assert grader(lambda *_: ...).passed is None


@pytest.mark.parametrize(
    ("grader", "wrong", "words"),
    [
        (graders.share_seen, lambda g, t: (1 - g ** (t + 1)) / (1 - g), "one term too many, and"),
        (graders.share_seen, lambda g, t: (1 - g ** (t + 1)) / (1 - g) / t, "γ⁰ to γ^(T−1)"),
        (graders.share_seen, lambda g, t: (1 - g**t) / (1 - g), "it is a share"),
        (graders.share_seen, lambda g, t: 1 / (1 - g) / t, "without end"),
        (graders.share_seen, lambda g, t: g**t, "add γ⁰"),
    ],
)
def test_known_mistakes_are_named(grader: Callable, wrong: Callable, words: str) -> None:
    verdict = grader(wrong)
    assert verdict.passed is False
    assert words in verdict.message, verdict
