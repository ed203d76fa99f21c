"""The grader of *The tanh-Gaussian* passes what PyTorch's own tanh confirms, and names the known mistakes."""

from collections.abc import Callable

import numpy as np
import pytest
import torch
from torch.distributions import Normal, TanhTransform, TransformedDistribution

from inbounds.book.exercises import tanh_gaussian as graders
from inbounds.distributions import LogitNormal


def ported(layer):
    return np.diag([0.5, 1.0]) @ layer - np.log(2) * (
        np.arange(2)[:, None] * (np.arange(layer.shape[1]) == layer.shape[1] - 1)
    )


def halved_only(layer):
    return np.diag([0.5, 1.0]) @ layer


RIGHT = {"ported": ported}


def test_the_right_answer_has_the_same_law() -> None:
    """The oracle is PyTorch's transformed Normal, not the formula."""
    rng = np.random.default_rng(1)
    layer, features = 0.3 * rng.normal(size=(2, 9)), np.append(rng.normal(size=8), 1.0)
    mu, log_sigma = torch.from_numpy(layer @ features)
    m, log_s = torch.from_numpy(ported(layer) @ features)
    action = torch.linspace(-0.9, 0.9, 7, dtype=torch.float64)
    tanh = TransformedDistribution(Normal(m, log_s.exp()), TanhTransform())
    logit_normal = LogitNormal(mu, log_sigma.exp(), -1.0, 1.0)
    torch.testing.assert_close(tanh.log_prob(action), logit_normal.log_prob(action))


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda layer: layer, "as it was"),
        (halved_only, "σ is not"),
        (lambda layer: layer + ported(layer) - halved_only(layer), "μ is not"),
        (lambda layer: np.diag([2.0, 1.0]) @ layer - (ported(layer) - halved_only(layer)), "wrong way round"),
        (lambda layer: layer / 2, "root of σ"),
        (lambda layer: halved_only(layer) - np.log(2) * np.arange(2)[:, None], "bias alone"),
        (lambda layer: -layer, "expected"),
    ],
)
def test_known_mistakes_are_named(wrong: Callable, words: str) -> None:
    verdict = graders.ported(wrong)
    assert verdict.passed is False
    assert words in verdict.message
