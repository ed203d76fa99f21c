"""The graders of *Three centres* pass the right answer, found by other means, and name the known mistakes."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy import optimize
from scipy.special import expit

from inbounds.book.exercises import three_centres as graders


def mode(loc, scale, low, high, side=None):
    """By bisection, on μ's side of zero or on the one asked for."""
    side = np.sign(loc) if side is None else side
    z = side * optimize.brentq(
        lambda z: side * (side * z - loc - scale**2 * np.tanh(side * z / 2)),
        max(0.0, side * loc) if side * loc > 0 else 2 * np.arctanh(np.sqrt(1 - 2 / scale**2)),
        abs(loc) + scale**2,
        xtol=1e-14,
    )
    return z, low + (high - low) * expit(z)


def gradient(loc, scale, low, high, part=1):
    """By central differences of the action's mode, or of its latent (part 0)."""
    h = 1e-5
    by_loc = mode(loc + h, scale, low, high)[part] - mode(loc - h, scale, low, high)[part]
    by_scale = mode(loc, scale + h, low, high)[part] - mode(loc, scale - h, low, high)[part]
    return np.array([by_loc, by_scale]) / (2 * h)


def slope(z, low, high):
    return (high - low) * expit(z) * expit(-z)


def without_denominator(loc, scale, low, high):
    z, _ = mode(loc, scale, low, high)
    return gradient(loc, scale, low, high) * (1 - 2 * scale**2 * expit(z) * expit(-z))


def lower(loc, scale, low, high):
    """Right with one peak; with two, the other one."""
    if scale < 2:
        return gradient(loc, scale, low, high)
    z, _ = mode(loc, scale, low, high, side=-np.sign(loc))
    bend = 1 - 2 * scale**2 * expit(z) * expit(-z)
    return np.array([1.0, 2 * scale * np.tanh(z / 2)]) * slope(z, low, high) / bend


RIGHT = {"mode_gradient": gradient}


@pytest.mark.parametrize(
    ("name", "wrong", "words"),
    [
        ("mode_gradient", lambda *a: gradient(*a, part=0), "*latent* mode"),
        ("mode_gradient", without_denominator, "denominator"),
        ("mode_gradient", lambda *a: gradient(*a, part=0) * slope(a[0], a[2], a[3]), "not at μ"),
        ("mode_gradient", lambda *a: gradient(*a) / [1.0, 2 * a[1]], "σ²"),
        ("mode_gradient", lambda *a: gradient(*a) / (a[3] - a[2]), "length"),
        ("mode_gradient", lambda *a: np.array([slope(a[0], a[2], a[3]), 0.0]), "median"),
        ("mode_gradient", lower, "lower mode"),
    ],
)
def test_known_mistakes_are_named(name: str, wrong: Callable, words: str) -> None:
    verdict = getattr(graders, name)(wrong)
    assert verdict.passed is False
    assert words in verdict.message
