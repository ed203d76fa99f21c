"""The grader of equal noise passes right answers, and names the known mistakes."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy import optimize

from inbounds.book.exercises import why as graders
from inbounds.learning import executed_std


def by_the_package(std: float) -> float:
    return float(optimize.brentq(lambda s: executed_std("gaussian", s) - std, 1e-3, 100, xtol=1e-12))


@pytest.mark.parametrize(
    ("grader", "right"),
    [(graders.matched_scale, by_the_package)],
)
def test_right_answers_pass(grader: Callable, right: Callable) -> None:
    assert grader(right).passed is True, grader(right)
    assert grader(lambda *_: ...).passed is None


@pytest.mark.parametrize(
    ("grader", "wrong", "words"),
    [
        (graders.matched_scale, lambda s: s, "before clipping"),
        (graders.matched_scale, lambda s: by_the_package(s) * 1.01, "counts as 1"),
        (
            graders.matched_scale,
            lambda s: by_the_package(s) if s < 0.5 else 1.1,
            "default of a Gaussian",
        ),
    ],
)
def test_known_mistakes_are_named(grader: Callable, wrong: Callable, words: str) -> None:
    verdict = grader(wrong)
    assert verdict.passed is False
    assert words in verdict.message, verdict


def test_a_truncated_gaussian_is_told_from_a_clipped_one() -> None:
    truncated = graders._scale_for(graders._truncated_std, 0.4)
    verdict = graders.matched_scale(lambda std: truncated if np.isclose(std, 0.4) else by_the_package(std))
    assert "cut off" in verdict.message
