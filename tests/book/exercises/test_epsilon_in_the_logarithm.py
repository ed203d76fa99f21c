"""The grader of the log-slope passes the stable forms and names the habits."""

from collections.abc import Callable

import pytest
import torch
from torch.nn.functional import logsigmoid, softplus

from inbounds.book.exercises import epsilon_in_the_logarithm as graders


def stable(x):
    return 2 * (torch.log(torch.tensor(2.0)) - x - softplus(-2 * x))


def by_logsigmoid(x):
    return torch.log(torch.tensor(4.0)) + logsigmoid(2 * x) + logsigmoid(-2 * x)


@pytest.mark.parametrize("right", [stable, by_logsigmoid])
def test_right_answers_pass(right: Callable) -> None:
    verdict = graders.log_slope(right)
    assert verdict.passed is True, verdict
    assert right.__name__ in repr(verdict)


@pytest.mark.parametrize("empty", [..., None, NotImplemented])
def test_an_unanswered_exercise_is_not_a_failure(empty: object) -> None:
    assert graders.log_slope(lambda x: empty).passed is None


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda x: torch.log(1 - torch.tanh(x) ** 2), "far out"),
        (lambda x: torch.log(1 - torch.tanh(x) ** 2 + 1e-6), "far out"),
        (lambda x: torch.log((1 - torch.tanh(x) ** 2).clamp(min=1e-6)), "far out"),
        (lambda x: 2 * (torch.log(torch.tensor(2.0)) - x - torch.log1p(torch.exp(-2 * x))), "overflows"),
        (lambda x: -stable(x), "sign is wrong"),
        (lambda x: stable(x) / 2, "factor 2"),
        (lambda x: torch.log(torch.tensor(2.0)) + logsigmoid(x) + logsigmoid(-x), "tanh(x/2)"),
        (lambda x: 0 * x, "the value or its derivative is wrong"),
        (lambda x: stable(x.detach()) + 0 * x, "the value or its derivative is wrong"),
        (lambda x: 1 / 0, "ZeroDivisionError"),
        (lambda x: by_logsigmoid(x) if x > 0 else stable(-x), "RuntimeError"),
        (lambda x: stable(x).mean() + 0 * x, "wrong for a tensor"),
    ],
)
def test_known_mistakes_are_named(wrong: Callable, words: str) -> None:
    verdict = graders.log_slope(wrong)
    assert verdict.passed is False
    assert words in verdict.message
