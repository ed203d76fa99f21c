"""Grader of the page *What PPO's details change* (`judging` tells how one works)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inbounds.book.exercises.judging import Case, Judgement, judge_cases

__all__ = ["scaled_rewards"]

TINY = 1e-8


def scaled_rewards(function: Callable[..., Any]) -> Judgement:
    """Rewards divided by the running standard deviation of the discounted return, then cut.

    Args:
        function: the reader's ``scaled_rewards(reward, ended, gamma, cut)``, of arrays `[T]`.

    Example:
        >>> scaled_rewards(lambda reward, ended, gamma, cut: reward)
        ✗ not yet: <lambda>: nothing is scaled
    """

    def of(reward: NDArray[Any], ended: NDArray[Any], gamma: float, cut: float) -> Any:
        return function(reward.copy(), ended.copy(), gamma, cut)

    of.__name__ = getattr(function, "__name__", "scaled_rewards")
    return judge_cases(of, [_case(0, 0.9, 10.0), _case(1, 0.5, 2.0)], "right, ends of episodes included")


def _sums(reward: NDArray[Any], ended: NDArray[Any], gamma: float) -> NDArray[Any]:
    """Return the discounted sum of past rewards at each step of each episode `[T]`."""
    starts = np.concatenate([[0], np.flatnonzero(ended) + 1])
    of_each = np.searchsorted(starts, np.arange(len(reward)), side="right") - 1
    return np.array(
        [
            sum(reward[k] * gamma ** (t - k) for k in range(starts[of_each[t]], t + 1))
            for t in range(len(reward))
        ]
    )


def _case(seed: int, gamma: float, cut: float) -> Case:
    rng = np.random.default_rng(seed)
    reward = rng.normal(300, 400, 60)
    ended = np.zeros(60, np.bool_)
    ended[[9, 10, 33]] = True

    def divided(
        sums: NDArray[Any], spread: Callable[[NDArray[Any]], Any] = np.std, mean: float = 0.0
    ) -> NDArray[Any]:
        scale = np.array([np.sqrt(spread(sums[: t + 1]) ** 2 + TINY) for t in range(60)])
        return np.asarray(np.clip((reward - mean) / scale, -cut, cut))

    sums = _sums(reward, ended, gamma)
    whole = np.sqrt(sums.std() ** 2 + TINY)
    uncut = np.array([reward[t] / np.sqrt(sums[: t + 1].std() ** 2 + TINY) for t in range(60)])
    mistakes: dict[str, Any] = {
        "nothing is scaled": reward,
        "the sum runs on across the end of an episode": divided(_sums(reward, np.zeros(60, np.bool_), gamma)),
        "that is the spread of the rewards: take that of their discounted sum": divided(reward),
        "the future is in it: the spread must be that of the sums so far": np.clip(reward / whole, -cut, cut),
        "the rewards are centred: that changes what an episode's end is worth, so divide only": divided(
            sums, mean=float(reward.mean())
        ),
        "nothing is cut": uncut,
        "that is the variance: its square root is missing": divided(sums, spread=lambda x: x.std() ** 2),
    }
    return Case((reward, ended, gamma, cut), divided(sums), mistakes, hint="some reward is wrong")
