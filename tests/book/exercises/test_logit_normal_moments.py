"""The grader of *Mean, mode and moments of a logit-normal*: it names the known mistakes."""

from collections.abc import Callable

import numpy as np
import pytest
import torch
from scipy.special import expit

from inbounds.book.exercises import logit_normal_moments as graders
from inbounds.distributions import LogitNormal


def law(loc, scale, low, high):
    loc, scale = torch.tensor(loc, dtype=torch.float64), torch.tensor(scale, dtype=torch.float64)
    return LogitNormal(loc, scale, low, high)


def variance(*arguments):
    return law(*arguments).variance.item()


def unit(loc, scale, low, high):
    return variance(loc, scale, 0.0, 1.0)


def coin(loc, scale, low, high):
    """m(1 − m), as if the action were 0 or 1."""
    mean = law(loc, scale, 0.0, 1.0).mean.item()
    return mean * (1 - mean) * (high - low) ** 2


def second_moment(loc, scale, low, high):
    mean = law(loc, scale, 0.0, 1.0).mean.item()
    return (unit(loc, scale, low, high) + mean**2) * (high - low) ** 2


def first_order(loc, scale, low, high):
    return (scale * (high - low) * expit(loc) * expit(-loc)) ** 2


RIGHT = {"action_variance": variance}


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (unit, "on (0, 1)"),
        (lambda m, s, lo, hi: unit(m, s, lo, hi) * (hi - lo), "not by L"),
        (lambda *a: np.sqrt(variance(*a)), "standard deviation"),
        (coin, "slope of the mean is missing"),
        (lambda *a: coin(*a) - variance(*a), "slope's share"),
        (second_moment, "second moment"),
        (lambda m, s, lo, hi: s**2, "Gaussian's variance"),
        (first_order, "first-order"),
        (lambda *a: -variance(*a), "expected"),
    ],
)
def test_known_mistakes_are_named(wrong: Callable, words: str) -> None:
    verdict = graders.action_variance(wrong)
    assert verdict.passed is False
    assert words in verdict.message
