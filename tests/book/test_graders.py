"""A grader passes the right answer, names the known mistakes, and lets an unanswered exercise be."""

import math
from collections.abc import Callable

import numpy as np
import pytest
import torch
from scipy import stats
from torch.nn.functional import logsigmoid

from inbounds.book import graders
from inbounds.distributions import LogitNormal


def outside(loc, scale, low, high):
    return stats.norm.cdf(low, loc, scale) + stats.norm.sf(high, loc, scale)


def stable(loc, scale, low, high):
    return -np.expm1(np.log1p(-outside(loc, scale, low, high)).sum())


def log_prob(latent, loc, scale, low, high):
    log_slope = logsigmoid(latent) + logsigmoid(-latent) + (high - low).log()
    return torch.distributions.Normal(loc, scale).log_prob(latent) - log_slope


def entropy(loc, scale, low, high):
    loc, scale = torch.tensor(loc, dtype=torch.float64), torch.tensor(scale, dtype=torch.float64)
    return LogitNormal(loc, scale, low, high).entropy().item()


def colleagues_entropy(loc, scale, low, high):
    """As the exercise prints it."""
    return 0.5 * np.log(2 * np.pi * np.e * scale**2) + loc - 2 * np.log1p(np.exp(loc))


RIGHT = {"mass_outside": stable, "log_prob_from_latent": log_prob, "entropy_by_quadrature": entropy}


@pytest.mark.parametrize("name", RIGHT)
@pytest.mark.parametrize("empty", [None, NotImplemented])
def test_a_function_that_returns_nothing_is_unanswered_too(name: str, empty: object) -> None:
    assert getattr(graders, name)(lambda *_: empty).passed is None


@pytest.mark.parametrize("name", RIGHT)
def test_an_exception_is_reported(name: str) -> None:
    verdict = getattr(graders, name)(lambda *_: 1 / 0)
    assert verdict.passed is False
    assert "ZeroDivisionError" in verdict.message


@pytest.mark.parametrize(
    ("name", "wrong", "words"),
    [
        ("mass_outside", lambda *a: np.prod(outside(*a)), "every"),
        ("mass_outside", lambda *a: np.sum(outside(*a)), "sum over coordinates"),
        ("mass_outside", lambda *a: np.prod(1 - outside(*a)), "inside"),
        ("mass_outside", lambda m, s, lo, hi: 1 - np.prod(stats.norm.cdf(hi, m, s)), "only the upper"),
        ("mass_outside", lambda m, s, lo, hi: 1 - np.prod(stats.norm.sf(lo, m, s)), "only the lower"),
        ("mass_outside", outside, "one probability per coordinate"),
        ("mass_outside", lambda *a: 1 - np.prod(1 - outside(*a)), "tiny probabilities"),
        ("mass_outside", lambda *a: 0.123, "expected"),
        (
            "log_prob_from_latent",
            lambda z, m, s, lo, hi: log_prob(z, m, s, lo, hi) + (hi - lo).log(),
            "length",
        ),
        (
            "log_prob_from_latent",
            lambda z, m, s, lo, hi: torch.distributions.Normal(m, s).log_prob(z),
            "Jacobian",
        ),
        (
            "log_prob_from_latent",
            lambda z, m, s, lo, hi: (
                2 * torch.distributions.Normal(m, s).log_prob(z) - log_prob(z, m, s, lo, hi)
            ),
            "wrong sign",
        ),
        (
            "log_prob_from_latent",
            lambda z, m, s, lo, hi: LogitNormal(m, s, lo, hi).log_prob(
                LogitNormal(m, s, lo, hi).latent_to_value(z)
            ),
            "use softplus",
        ),
        ("entropy_by_quadrature", lambda m, s, lo, hi: stats.norm.entropy(m, s), "Gaussian's entropy"),
        ("entropy_by_quadrature", lambda m, s, lo, hi: entropy(m, s, lo, hi) - math.log(hi - lo), "length"),
        ("entropy_by_quadrature", lambda *a: -entropy(*a), "sign"),
        ("entropy_by_quadrature", colleagues_entropy, "both errors"),
        (
            "entropy_by_quadrature",
            lambda m, s, lo, hi: colleagues_entropy(m, s, lo, hi) + math.log(hi - lo),
            "average it over z",
        ),
    ],
)
def test_known_mistakes_are_named(name: str, wrong: Callable, words: str) -> None:
    verdict = getattr(graders, name)(wrong)
    assert verdict.passed is False
    assert words in verdict.message


def test_a_verdict_shows_itself() -> None:
    verdict = graders.Verdict("f", False, "a < b")
    assert repr(verdict) == "✗ not yet: f: a < b"
    assert "a &lt; b" in verdict._repr_html_()
