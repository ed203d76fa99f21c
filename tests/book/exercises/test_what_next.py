"""The grader of the moving box passes the package's own command, and names the known mistakes."""

import math
from collections.abc import Callable

import pytest
import torch

from inbounds.book.exercises import what_next as graders
from inbounds.distributions import LogitNormal


def by_the_package(z: float, last: float, rate: float) -> float:
    low, high = max(-1.0, last - rate), min(1.0, last + rate)
    law = LogitNormal(*torch.tensor([0.0, 1.0], dtype=torch.float64), low, high)
    return law.latent_to_value(torch.tensor(z, dtype=torch.float64)).item()


def cut(z: float, last: float, rate: float) -> float:
    return min(max(math.tanh(z / 2), last - rate, -1.0), last + rate, 1.0)


def test_right_answers_pass() -> None:
    assert graders.command(by_the_package).passed is True, graders.command(by_the_package)
    assert graders.command(lambda *_: ...).passed is None


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (cut, "squash into the box of this step"),
        (lambda z, last, rate: last + rate * math.tanh(z / 2), "motor's own bounds are missing"),
        (lambda z, last, rate: by_the_package(2 * z, last, rate), "tanh(z/2), not tanh(z)"),
        (lambda z, last, rate: 1 / (1 + math.exp(-z)), "has to be stretched"),
        (lambda z, last, rate: by_the_package(z, last, rate) + 0.01, "expected"),
    ],
)
def test_known_mistakes_are_named(wrong: Callable, words: str) -> None:
    verdict = graders.command(wrong)
    assert verdict.passed is False
    assert words in verdict.message, verdict
