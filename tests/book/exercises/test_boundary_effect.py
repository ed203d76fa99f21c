"""The grader of the boundary effect passes the right score and names the known mistakes."""

from collections.abc import Callable

import numpy as np
import pytest
import torch
from scipy import special, stats

from inbounds.book.exercises import boundary_effect as graders
from inbounds.distributions import ClippedNormal


def gaussian(action, loc, scale, low, high):
    t = (action - loc) / scale
    return np.array([t / scale, t * t - 1])


def by_autograd(action, loc, scale, low, high):
    """An independent road: the package's law, differentiated."""
    parameters = torch.tensor([loc, np.log(scale)], dtype=torch.float64, requires_grad=True)
    law = ClippedNormal(parameters[0], parameters[1].exp(), low, high)
    return torch.autograd.grad(law.log_prob(torch.tensor(action, dtype=torch.float64)), parameters)[0].numpy()


def by_hand(action, loc, scale, low, high, log_mass=special.log_ndtr):
    if low < action < high:
        return gaussian(action, loc, scale, low, high)
    side = 1 if action == high else -1
    w = side * (action - loc) / scale
    hazard = np.exp(stats.norm.logpdf(w) - log_mass(-w))
    return np.array([side * hazard / scale, w * hazard])


@pytest.mark.parametrize("right", [by_hand, by_autograd])
def test_right_answers_pass(right: Callable) -> None:
    assert graders.capg_score(right).passed is True


def test_an_unanswered_exercise_is_not_a_failure() -> None:
    assert graders.capg_score(lambda *_: ...).passed is None


def on_bounds_only(wrong: Callable) -> Callable:
    return lambda a, m, s, lo, hi: by_hand(a, m, s, lo, hi) if lo < a < hi else wrong(a, m, s, lo, hi)


def mass(a, m, s, lo, hi):
    return stats.norm.sf(hi, m, s) if a == hi else stats.norm.cdf(lo, m, s)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (gaussian, "a mass, not a density"),
        (on_bounds_only(lambda *args: by_hand(*args) * mass(*args)), "of its *logarithm*"),
        (on_bounds_only(lambda a, m, s, *_: np.full(2, stats.norm.pdf((a - m) / s))), "density at the bound"),
        (lambda a, m, s, lo, hi: by_hand(a, m, s, lo, hi) * (-1 if a == hi else 1), "wrong side"),
        (lambda a, m, s, lo, hi: by_hand(a, m, s, lo, hi) / [1, s], "derivative in σ"),
        (lambda a, m, s, lo, hi: by_hand(a, m, s, lo, hi) * [s, 1], "factor 1/σ"),
        (lambda *args: gaussian(*args) + 1, "between the bounds"),
        (lambda *args: 0.0 * gaussian(*args), "between the bounds"),
    ],
)
def test_known_mistakes_are_named(wrong: Callable, words: str) -> None:
    verdict = graders.capg_score(wrong)
    assert verdict.passed is False
    assert words in verdict.message


def test_an_underflowing_mass_is_named() -> None:
    def naive(w):
        with np.errstate(divide="ignore"):
            return np.log(stats.norm.cdf(w))

    def wrong(*args):
        with np.errstate(invalid="ignore", over="ignore"):
            return by_hand(*args, log_mass=naive)

    verdict = graders.capg_score(wrong)
    assert verdict.passed is False
    assert "log_ndtr" in verdict.message
