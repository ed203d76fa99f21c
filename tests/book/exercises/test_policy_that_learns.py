"""The graders of the sixty lines pass right answers, and name the known mistakes."""

from collections.abc import Callable

import numpy as np
import pytest
import torch

from inbounds.book.exercises import policy_that_learns as graders
from inbounds.learning import gae


def by_gae(reward, terminated, truncated, next_value, gamma):
    """The package's returns at λ = 1."""
    columns = (reward, np.zeros(len(reward)), terminated, truncated, next_value)
    rows = [torch.from_numpy(np.asarray(column)[None]) for column in columns]
    return gae(*rows, gamma=gamma, gae_lambda=1.0)[1][0].numpy()


def backwards(
    reward,
    terminated,
    truncated,
    next_value,
    gamma,
    *,
    cut=True,
    last=True,
    end=True,
    apart=True,
    discount=True,
):
    later, to_go = next_value[-1] if last else 0.0, np.zeros(len(reward))
    for t in reversed(range(len(reward))):
        if terminated[t] and apart:
            later = 0.0 if end else next_value[t]
        elif terminated[t] and t == len(reward) - 1:
            later = 0.0
        elif truncated[t] and apart:
            later = next_value[t] if cut else 0.0
        to_go[t] = later = reward[t] + (gamma if discount else 1.0) * later
    return to_go


def autograd(latent, loc, log_scale):
    parameters = torch.tensor([loc, log_scale], dtype=torch.float64)

    def log_prob(p):
        return torch.distributions.Normal(p[0], p[1].exp()).log_prob(torch.from_numpy(latent))

    return torch.autograd.functional.jacobian(log_prob, parameters).T.numpy()


RIGHT = {"rewards_to_go": backwards, "score": autograd}


def cut_first(reward, terminated, truncated, next_value, gamma):
    """Asks for the cut before the end: where a step is both, something follows."""
    to_go, later = np.zeros(len(reward)), next_value[-1]
    for t in reversed(range(len(reward))):
        later = next_value[t] if truncated[t] else 0.0 if terminated[t] else later
        to_go[t] = later = reward[t] + gamma * later
    return to_go


def test_an_end_that_is_a_cut_too_is_an_end() -> None:
    verdict = graders.rewards_to_go(cut_first)
    assert verdict.passed is False
    assert "after a *terminated* step nothing follows" in verdict.message


def test_the_reward_to_go_is_the_packages_return() -> None:
    assert graders.rewards_to_go(by_gae).passed is True


@pytest.mark.parametrize(
    ("flaw", "words"),
    [
        ({"last": False}, "last step of the batch is no end"),
        ({"cut": False}, "a truncated step still counts as an end"),
        ({"apart": False}, "rewards leak"),
        ({"end": False}, "after a *terminated* step nothing follows"),
        ({"discount": False}, "not discounted"),
    ],
)
def test_mistakes_in_the_reward_to_go(flaw: dict[str, bool], words: str) -> None:
    verdict = graders.rewards_to_go(lambda *a: backwards(*a, **flaw))
    assert verdict.passed is False
    assert words in verdict.message


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda *a: autograd(*a) / [[1], [np.exp(a[2])]], "derivative in σ"),
        (lambda *a: autograd(*a) * [[np.exp(a[2])], [1]], "factor 1/σ"),
        (lambda *a: autograd(*a) + np.array([[0], [1]]), "lacks the −1"),
        (lambda *a: -autograd(*a), "sign is wrong"),
        (lambda *a: autograd(*a)[::-1], "exchanged"),
        (lambda *a: autograd(*a).T, "transpose"),
        (lambda *a: autograd(*a) + 0.5, "the value is wrong"),
    ],
)
def test_mistakes_in_the_score(wrong: Callable, words: str) -> None:
    verdict = graders.score(wrong)
    assert verdict.passed is False
    assert words in verdict.message
