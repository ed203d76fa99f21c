"""The graders of the policy gradient pass the right answers and name the known mistakes."""

from collections.abc import Callable

import numpy as np
import pytest
import torch

from inbounds.book.exercises import policy_gradient as graders
from inbounds.learning import gae


def leave_one_out(latent, returns, loc, log_scale, baseline=None):
    """Draw by draw, by autograd."""
    total = np.zeros(2)
    for i in range(len(returns)):
        parameters = torch.tensor([loc, log_scale], dtype=torch.float64, requires_grad=True)
        law = torch.distributions.Normal(parameters[0], parameters[1].exp())
        log_prob = law.log_prob(torch.tensor(latent[i], dtype=torch.float64))
        (score,) = torch.autograd.grad(log_prob, parameters)
        others = np.delete(returns, i).mean() if baseline is None else baseline(returns)
        total += score.numpy() * (returns[i] - others)
    return total / len(returns)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda *a: leave_one_out(*a, baseline=np.mean), "leave its own out"),
        (lambda *a: leave_one_out(*a, baseline=lambda r: 0.0), "baseline is missing"),
        (lambda *a: leave_one_out(*a) * len(a[1]), "take their mean"),
        (lambda *a: leave_one_out(*a) / [1, np.exp(a[3])], "derivative in σ"),
        (lambda *a: leave_one_out(*a) * [np.exp(a[3]), 1], "factor 1/σ"),
        (lambda *a: -leave_one_out(*a), "sign is wrong"),
        (lambda *a: leave_one_out(*a) + 1, "the value is wrong"),
    ],
)
def test_leave_one_out_mistakes(wrong: Callable, words: str) -> None:
    verdict = graders.leave_one_out_gradient(wrong)
    assert verdict.passed is False
    assert words in verdict.message


def by_gae(reward, next_value, terminated, truncated, gamma, lam):
    """The package's returns are λ-returns, whatever the values before the steps."""
    value = np.append(0.3, next_value[:-1])  # right within an episode
    columns = (reward, value, terminated, truncated, next_value)
    rows = [torch.from_numpy(np.asarray(x)[None]) for x in columns]
    return gae(*rows, gamma=gamma, gae_lambda=lam)[1][0].numpy()


def recursion(reward, next_value, terminated, truncated, gamma, lam, *, cut=True, last=True, ends=True):
    returns, following = np.zeros(len(reward)), next_value[-1] if last else 0.0
    for t in reversed(range(len(reward))):
        stop = terminated[t] * ends
        if truncated[t]:
            following, stop = next_value[t], stop or not cut
        elif terminated[t]:
            following = next_value[t]
        after = (1 - lam) * next_value[t] + lam * following
        following = reward[t] + gamma * after * (1 - stop)
        returns[t] = following
    return returns


@pytest.mark.parametrize("right", [by_gae, recursion])
def test_right_answers_pass(right: Callable) -> None:
    assert graders.lambda_returns(right).passed is True
    assert graders.leave_one_out_gradient(leave_one_out).passed is True


def test_unanswered_exercises_are_no_failures() -> None:
    assert graders.lambda_returns(lambda *_: ...).passed is None
    assert graders.leave_one_out_gradient(lambda *_: ...).passed is None


def printed(reward, next_value, terminated, truncated, gamma, lam):
    """The exercise as it is printed, both errors included."""
    done = terminated | truncated
    returns = np.zeros(len(reward))
    following = 0.0
    for t in reversed(range(len(reward))):
        after = (1 - lam) * next_value[t] + lam * following
        following = reward[t] + gamma * after * (1 - done[t])
        returns[t] = following
    return returns


def leaking(reward, next_value, terminated, truncated, gamma, lam):
    returns, following = np.zeros(len(reward)), next_value[-1]
    for t in reversed(range(len(reward))):
        after = (1 - lam) * next_value[t] + lam * following
        following = reward[t] + gamma * after * (1 - terminated[t])
        returns[t] = following
    return returns


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (printed, "neither is the rollout's last step"),
        (lambda *a: recursion(*a, cut=False), "still counts as the end of the world"),
        (lambda *a: recursion(*a, last=False), "begin with its next value"),
        (lambda *a: recursion(*a, ends=False), "*terminated* step has nothing after it"),
        (leaking, "leak from one episode"),
        (lambda *a: recursion(*a) + 1, "the value is wrong"),
    ],
)
def test_lambda_return_mistakes(wrong: Callable, words: str) -> None:
    verdict = graders.lambda_returns(wrong)
    assert verdict.passed is False
    assert words in verdict.message
