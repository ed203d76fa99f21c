"""The grader of *Other libraries* passes right answers, and names the known mistakes."""

from collections.abc import Callable

import numpy as np
import pytest

from inbounds.book.exercises import other_libraries as graders


def actions(latent, low, high):
    near = (high - low) * np.exp(-np.logaddexp(0, np.abs(latent)))
    return np.where(latent > 0, high - near, low + near), near


def plain(latent, low, high):
    return low + (high - low) / (1 + np.exp(-latent))


RIGHT = {"actions_of": actions}


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda z, lo, hi: (plain(z, lo, hi), None), "is missing"),
        (plain, "is missing"),
        (
            lambda z, lo, hi: (
                plain(z, lo, hi),
                np.minimum(plain(z, lo, hi) - lo, hi - plain(z, lo, hi)),
            ),
            "subtraction has lost it",
        ),
        (lambda z, lo, hi: (plain(z, lo, hi), plain(z, 0 * lo, hi - lo)), "lower bound everywhere"),
        (lambda z, lo, hi: (plain(z, lo, hi), plain(-z, 0 * lo, hi - lo)), "upper bound everywhere"),
        (lambda z, lo, hi: actions(2 * z, lo, hi), "twice the slope"),
        (lambda z, lo, hi: (actions(z, lo, hi)[0], actions(z, 0 * lo, 0 * hi + 1)[1]), "no units"),
        (lambda z, lo, hi: actions(z, 0 * lo - 1, 0 * hi + 1), "the unit box"),
        (lambda z, lo, hi: actions(z, lo, hi)[::-1], "changed places"),
        (lambda z, lo, hi: actions(z + 1, lo, hi), "some action or distance"),
    ],
)
def test_known_mistakes_are_named(wrong: Callable, words: str) -> None:
    verdict = graders.actions_of(wrong)
    assert verdict.passed is False
    assert words in verdict.message
