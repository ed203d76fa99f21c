"""The grader of bits for latents passes the answer found by rounding with fifty digits, and names the mistakes."""

import math
from collections.abc import Callable

import mpmath
import pytest

from inbounds.book.exercises import storing_actions as graders


def by_rounding(z):
    """Add bits until the stored action is not the bound."""
    mpmath.mp.dps = 50
    distance = 2 / (1 + mpmath.exp(mpmath.mpf(z)))
    return float(next(bits for bits in range(1, 100) if mpmath.nint(distance * 2**bits) > 0))


RIGHT = {"bits_for": by_rounding}


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda z: math.ceil(z / math.log(2)), "two bits too many"),
        (lambda z: math.ceil(z / math.log(2) - 1), "one bit too many"),
        (lambda z: math.floor(z / math.log(2) - 2), "one bit too few"),
        (lambda z: math.ceil((z - math.log(4)) / math.log(10)), "decimal"),
        (lambda z: math.ceil(z - 2), "divide by log 2"),
        (lambda z: 24, "expected"),
    ],
)
def test_known_mistakes_are_named(wrong: Callable, words: str) -> None:
    verdict = graders.bits_for(wrong)
    assert verdict.passed is False
    assert words in verdict.message
