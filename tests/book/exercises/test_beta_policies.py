"""The grader of *Beta policies* passes the right log-density and names the known mistakes."""

import math
from collections.abc import Callable

import numpy as np
import pytest
import torch

from inbounds.book.exercises import beta_policies as graders
from inbounds.distributions import ScaledBeta


def by_the_package(action, alpha, beta, low, high):
    """An independent road: the package's law."""
    numbers = (torch.tensor(x, dtype=torch.float64) for x in (action, alpha, beta, low, high))
    a, *law = numbers
    return ScaledBeta(*law).log_prob(a).item()


RIGHT = {"beta_log_prob": by_the_package}


def fraction(action, low, high):
    return (action - low) / (high - low)


def overflowing(action, alpha, beta, low, high):
    """The normaliser as a quotient of gamma functions."""
    with np.errstate(over="ignore", invalid="ignore"):
        x = fraction(action, low, high)
        gamma = [math.gamma(t) if t < 170 else math.inf for t in (alpha, beta, alpha + beta)]
        density = x ** (alpha - 1) * (1 - x) ** (beta - 1) * np.float64(gamma[2]) / gamma[0] / gamma[1]
        return np.log(density / (high - low))


def shifted(by):
    """Right, but for a term."""
    return lambda a, *rest: by_the_package(a, *rest) + by(fraction(a, *rest[2:]), *rest)


def log_b(alpha, beta):
    return math.lgamma(alpha) + math.lgamma(beta) - math.lgamma(alpha + beta)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (shifted(lambda x, a, b, lo, hi: math.log(hi - lo)), "length of the interval is missing"),
        (shifted(lambda x, a, b, lo, hi: 2 * math.log(hi - lo)), "do not multiply"),
        (lambda y, a, b, lo, hi: by_the_package(y, b, a, lo, hi), "changed places"),
        (shifted(lambda x, a, b, lo, hi: log_b(a, b)), "normaliser is missing"),
        (shifted(lambda x, a, b, lo, hi: 2 * log_b(a, b)), "sign of log B"),
        (shifted(lambda x, a, b, lo, hi: math.log(x) + math.log(1 - x)), "exponents"),
        (lambda *args: math.exp(by_the_package(*args)), "return its logarithm"),
        (overflowing, "overflows"),
        (lambda *_: 0.5, ""),
    ],
)
def test_known_mistakes_are_named(wrong: Callable, words: str) -> None:
    verdict = graders.beta_log_prob(wrong)
    assert verdict.passed is False, verdict
    assert words in verdict.message


def test_units_are_named() -> None:
    def unscaled(action, alpha, beta, low, high):
        if not 0 < action < 1:
            return math.nan
        return by_the_package(action, alpha, beta, 0.0, 1.0) - math.log(high - low)

    assert "fraction" in graders.beta_log_prob(unscaled).message
