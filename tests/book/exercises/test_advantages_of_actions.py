"""The graders of advantages pass the right answers and name the known mistakes."""

from collections.abc import Callable

import numpy as np
import pytest
import torch

from inbounds.book.exercises import advantages_of_actions as graders
from inbounds.learning import gae


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


def test_the_recursion_passes() -> None:
    assert graders.lambda_returns(recursion).passed is True


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


def cut_first(reward, next_value, terminated, truncated, gamma, lam):
    """Asks for the cut before the end: where a step is both, something follows."""
    returns, following = np.zeros(len(reward)), next_value[-1]
    for t in reversed(range(len(reward))):
        following = next_value[t] if truncated[t] else following
        after = (1 - lam) * next_value[t] + lam * following
        following = reward[t] + gamma * after * (truncated[t] or not terminated[t])
        returns[t] = following
    return returns


def test_an_end_that_is_a_cut_too_is_an_end() -> None:
    verdict = graders.lambda_returns(cut_first)
    assert verdict.passed is False
    assert "a *terminated* step has nothing after it" in verdict.message


def growing(batch, critic, gamma=0.99, lam=0.95, *, ends=1.0, cuts=0.0, stop=(1, 1), weight=None, plus=1.0,
            added=False, graph=()):  # fmt: skip
    """The growing program's, with its mistakes on demand."""
    value, after = critic(batch.obs), critic(batch.next_obs)
    value, after = value if "now" in graph else value.detach(), after if "next" in graph else after.detach()
    alive = 1 - ends * batch.terminated - cuts * batch.truncated
    residual = batch.reward + gamma * alive * after - value
    keep = (gamma * lam if weight is None else weight(gamma, lam)) * (1 - stop[0] * batch.terminated)
    keep = keep * (1 - stop[1] * batch.truncated)
    keep = gamma * lam * (1 - (batch.terminated + batch.truncated)) if added else keep
    advantage, later = torch.zeros_like(value), 0
    for t in reversed(range(len(value))):
        advantage[t] = later = residual[t] + keep[t] * later
    return advantage, advantage + plus * value


RIGHT = {
    "advantages": growing,
    "half_life": lambda gamma: np.log(0.5) / np.log(gamma),
    "lambda_returns": by_gae,
}


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda *a: growing(*a, cuts=1.0), "a truncated step counts as an end"),
        (lambda *a: growing(*a, ends=0.0), "multiply the next value by 1 − terminated"),
        (lambda *a: growing(*a, stop=(0, 0)), "stop at terminated and at truncated"),
        (lambda *a: growing(*a, stop=(1, 0)), "stop at truncated steps as well"),
        (lambda *a: growing(*a, weight=lambda gamma, lam: lam), "not λ^l"),
        (lambda *a: growing(*a, weight=lambda gamma, lam: 0.0), "residuals alone"),
        (lambda *a: growing(*a)[0], "return two things"),
        (lambda *a: growing(*a, plus=-1.0), "*plus* the value"),
        (lambda *a: growing(*a, plus=0.0), "not the advantage"),
        (
            lambda batch, critic, *a: (
                back := growing(batch, critic, *a)[0].flip(0),
                back + critic(batch.obs),
            ),
            "wrong way round",
        ),
        (lambda *a: growing(*a)[::-1], "the other way round"),
        (
            lambda batch, critic, *a: (
                found := growing(batch, critic, *a)[0],
                found + critic(batch.next_obs),
            ),
            "not of next_obs",
        ),
        (lambda *a: growing(*a, weight=lambda gamma, lam: gamma), "λ is missing"),
        (lambda *a: growing(*a, added=True), "a step can have both flags"),
        (lambda *a: growing(*a, graph=("now", "next")), ".detach() both values"),
        (lambda *a: growing(*a, graph=("now",)), ".detach() both values"),
        (lambda *a: growing(*a, graph=("next",)), ".detach() both values"),
        (lambda *a: tuple(1 + x for x in growing(*a)), "the value is wrong"),
        (lambda batch, critic, gamma, lam: batch.rewards, "AttributeError"),
    ],
)
def test_mistakes_of_the_growing_program(wrong: Callable, words: str) -> None:
    verdict = graders.advantages(wrong)
    assert verdict.passed is False
    assert words in verdict.message


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda g: np.log(2) / np.log(g), "sign"),
        (lambda g: g / 2, "logarithms"),
        (lambda g: 1 / (1 - g), "not the half-life"),
        (lambda g: np.log(g) / np.log(0.5), "swapped"),
    ],
)
def test_mistakes_of_the_half_life(wrong: Callable, words: str) -> None:
    assert words in graders.half_life(wrong).message
