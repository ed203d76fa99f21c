"""The graders of *KL invariance* pass the right answer, found by other means, and name the known mistakes."""

from collections.abc import Callable

import numpy as np
import pytest
import torch
from torch.distributions import Normal, kl_divergence

from inbounds.book.exercises import kl_invariance as graders
from inbounds.distributions import LogitNormal


def score(action, loc, log_scale, low, high):
    """By automatic differentiation of the density over actions."""
    parameters = torch.tensor([loc, log_scale], dtype=torch.float64, requires_grad=True)
    law = LogitNormal(parameters[0], parameters[1].exp(), low, high)
    (gradient,) = torch.autograd.grad(law.log_prob(torch.tensor(action, dtype=torch.float64)), parameters)
    return gradient.numpy()


def kl(loc, scale, loc_new, scale_new):
    old, new = (Normal(*map(torch.as_tensor, pair)) for pair in ((loc, scale), (loc_new, scale_new)))
    return kl_divergence(old, new).numpy()


RIGHT = {"squashed_score": score, "mean_kl": lambda *a: kl(*a).sum(1).mean()}


def gaussian_score(at, loc, log_scale):
    u = (at - loc) / np.exp(log_scale)
    return np.array([u / np.exp(log_scale), u**2 - 1])


def jacobian_too(action, loc, log_scale, low, high):
    latent = np.log((action - low) / (high - action))
    return score(action, loc, log_scale, low, high) + np.array([np.tanh(latent / 2), 0.0])


@pytest.mark.parametrize(
    ("name", "wrong", "words"),
    [
        ("squashed_score", lambda a, m, s, lo, hi: gaussian_score(a, m, s), "at the *action"),
        (
            "squashed_score",
            lambda a, m, s, lo, hi: gaussian_score(np.log(a / (1 - a)), m, s),
            "forgets the box",
        ),
        (
            "squashed_score",
            lambda a, m, s, lo, hi: gaussian_score(2 * np.arctanh(a), m, s),
            "on [−1, 1] only",
        ),
        ("squashed_score", lambda *a: score(*a) / [1.0, np.exp(a[2])], "not log σ"),
        ("squashed_score", lambda *a: -score(*a), "sign"),
        ("squashed_score", jacobian_too, "does not belong"),
        ("squashed_score", lambda *a: score(*a)[::-1], "order"),
        ("squashed_score", lambda *a: np.zeros(2), "expected"),
        ("mean_kl", lambda a, b, c, d: kl(c, d, a, b).mean(), "both errors"),
        ("mean_kl", lambda a, b, c, d: kl(c, d, a, b).sum(1).mean(), "new‖old"),
        ("mean_kl", lambda *a: kl(*a).mean(), "averaged over action dimensions"),
        ("mean_kl", lambda *a: kl(*a).sum(), "summed over states"),
        ("mean_kl", lambda *a: kl(*a).sum(1), "one number per state: "),
        ("mean_kl", kl, "per state and dimension"),
    ],
)
@pytest.mark.filterwarnings("ignore:invalid value encountered in log")
def test_known_mistakes_are_named(name: str, wrong: Callable, words: str) -> None:
    verdict = getattr(graders, name)(wrong)
    assert verdict.passed is False
    assert words in verdict.message
