"""Graders of the chapter *A policy that learns, in sixty lines* (`judging` tells how one works)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from inbounds.book.exercises.judging import Case, Judgement, judge_cases

__all__ = ["rewards_to_go", "score"]


def rewards_to_go(function: Callable[..., Any]) -> Judgement:
    """The rewards to go of a batch in which episodes end, are cut off, and go on."""
    rng = np.random.default_rng(0)

    def case(steps: int, ended: tuple[int, ...], cut: tuple[int, ...], gamma: float) -> Case:
        reward, next_value = rng.normal(size=(2, steps)) + 1.0
        terminated, truncated = np.zeros((2, steps), bool)
        terminated[list(ended)], truncated[list(cut)] = True, True
        arguments = (reward, terminated, truncated, next_value, gamma)

        def wrong(**flaws: bool) -> np.ndarray:
            return _summed(*arguments, **flaws)

        mistakes = {
            "the last step of the batch is no end: what would have come is its next_value": wrong(
                last_ends=True
            ),
            "a truncated step still counts as an end: next_value stands for what follows": wrong(
                cut_ends=True
            ),
            "neither a cut nor the batch's last step is an end: next_value stands for what follows": wrong(
                last_ends=True, cut_ends=True
            ),
            "rewards leak from one episode into the one before: start afresh where one stops": wrong(
                leaks=True
            ),
            "after a *terminated* step nothing follows: no next_value there": wrong(end_goes_on=True),
            "what comes later is not discounted: multiply it by gamma": _summed(*arguments[:4], 1.0),
        }
        return Case(arguments, wrong(), mistakes)

    cases = [
        case(6, (), (), 0.9),
        case(6, (), (2,), 0.9),
        case(6, (2,), (), 0.9),
        case(12, (1, 8), (4,), 0.97),
        case(5, (4,), (), 0.9),
        case(6, (2,), (2,), 0.9),  # the last step of the clock may also be a fall
    ]
    return judge_cases(function, cases, "right: ends end, cuts do not")


def _summed(
    reward: Any,
    terminated: Any,
    truncated: Any,
    next_value: Any,
    gamma: float,
    *,
    last_ends: bool = False,
    cut_ends: bool = False,
    leaks: bool = False,
    end_goes_on: bool = False,
) -> np.ndarray:
    """The reward to go by its definition, a sum for each step; flaws on demand."""
    steps = len(reward)
    total = np.zeros(steps)
    for t in range(steps):
        for k in range(t, steps):
            total[t] += gamma ** (k - t) * reward[k]
            stopped = (terminated[k] or truncated[k]) and not leaks
            if stopped or k == steps - 1:
                nothing = (
                    (terminated[k] and not end_goes_on)
                    or (truncated[k] and cut_ends)
                    or (k == steps - 1 and not terminated[k] and not truncated[k] and last_ends)
                )
                total[t] += 0.0 if nothing else gamma ** (k - t + 1) * next_value[k]
                break
    return total


def score(function: Callable[..., Any]) -> Judgement:
    """The derivatives of a Normal log-density with respect to μ and log σ, `[2, N]`."""
    rng = np.random.default_rng(0)

    def case(n: int, loc: float, log_scale: float) -> Case:
        latent = rng.normal(loc, 2.0, n)
        variance = np.exp(2 * log_scale)
        off = latent - loc
        right = np.stack([off / variance, off**2 / variance - 1])
        std = np.exp(log_scale)
        mistakes = {
            "the second row is the derivative in σ; in log σ it is σ times that": right / [[1.0], [std]],
            "the first row lacks a factor 1/σ: u itself depends on μ by 1/σ": right * [[std], [1.0]],
            "log_scale is log σ: take its exponential first": np.stack(
                [off / log_scale**2, off**2 / log_scale**2 - 1]
            ),
            "the second row lacks the −1 of −log σ": right + np.array([[0.0], [1.0]]),
            "the sign is wrong: a latent above μ is made more probable by raising μ": -right,
            "the rows are exchanged: μ first, then log σ": right[::-1],
            "transpose it: two rows, a column for each latent": right.T,
        }
        return Case((latent, loc, log_scale), right, mistakes)

    return judge_cases(
        function, [case(5, 0.3, -0.5), case(3, -1.0, 0.4)], "right: and its mean under the law is 0"
    )
