"""The graders of the chapter *The logit-normal density*: they name the known mistakes."""

import math
from collections.abc import Callable

import numpy as np
import pytest
import torch
from scipy import stats
from torch.nn.functional import logsigmoid

from inbounds.book.exercises import logit_normal_density as graders
from inbounds.distributions import LogitNormal


def log_prob(latent, loc, scale, low, high):
    log_slope = logsigmoid(latent) + logsigmoid(-latent) + (high - low).log()
    return torch.distributions.Normal(loc, scale).log_prob(latent) - log_slope


def entropy(loc, scale, low, high):
    loc, scale = torch.tensor(loc, dtype=torch.float64), torch.tensor(scale, dtype=torch.float64)
    return LogitNormal(loc, scale, low, high).entropy().item()


def colleagues_entropy(loc, scale, low, high):
    """As the exercise prints it."""
    return 0.5 * np.log(2 * np.pi * np.e * scale**2) + loc - 2 * np.log1p(np.exp(loc))


RIGHT = {"log_prob_from_latent": log_prob, "entropy_by_quadrature": entropy}


@pytest.mark.parametrize(
    ("name", "wrong", "words"),
    [
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
        ("entropy_by_quadrature", lambda *a: entropy(*a) + 1e-3, "samples give no more"),
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
