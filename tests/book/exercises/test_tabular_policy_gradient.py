"""The grader of the policy gradient on six cells passes the right answer and names the known mistakes."""

from collections.abc import Callable

import numpy as np
import pytest
import torch

from inbounds.book.exercises import tabular_policy_gradient as graders


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


def test_right_and_missing_answers() -> None:
    assert graders.leave_one_out_gradient(leave_one_out).passed is True
    assert graders.leave_one_out_gradient(lambda *_: ...).passed is None
