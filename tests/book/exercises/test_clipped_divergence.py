"""The grader of *Trust region of what?* passes the right answer, found otherwise, and names the known mistakes."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy import integrate, optimize, stats

from inbounds.book.exercises import clipped_divergence as graders


def kl(mu, mu_new, scale):
    """Of clipped Gaussians, by adaptive quadrature between the bounds and the probabilities on them."""
    old, new = stats.norm(mu, scale), stats.norm(mu_new, scale)
    inside, _ = integrate.quad(
        lambda z: old.pdf(z) * (old.logpdf(z) - new.logpdf(z)), -1, 1, epsabs=1e-13, points=[0.0, 0.9]
    )
    low = old.cdf(-1) * (old.logcdf(-1) - new.logcdf(-1))
    return inside + low + old.sf(1) * (old.logsf(1) - new.logsf(1))


def step(mu, scale, max_kl, direction=-1, swapped=False):
    def excess(x):
        there = mu + direction * x
        return (kl(there, mu, scale) if swapped else kl(mu, there, scale)) - max_kl

    return optimize.brentq(excess, 1e-6, mu + 6 * scale)


RIGHT = {"largest_step": step}


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda mu, scale, max_kl: scale * np.sqrt(2 * max_kl), "Gaussian's step"),
        (lambda mu, *rest: mu - step(mu, *rest), "where μ arrives"),
        (lambda *a: step(*a, direction=1), "outwards"),
        (lambda *a: step(*a, swapped=True), "new to old"),
        (lambda *a: -step(*a), "sign"),
        (lambda *a: 2 * step(*a), "expected"),
    ],
)
def test_known_mistakes_are_named(wrong: Callable, words: str) -> None:
    verdict = graders.largest_step(wrong)
    assert verdict.passed is False
    assert words in verdict.message
