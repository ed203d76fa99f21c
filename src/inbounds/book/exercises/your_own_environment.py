"""Graders of the chapter *Your own environment* (`judging` tells how one works)."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from gymnasium.vector import VectorEnv
from numpy.typing import NDArray

from inbounds.book.environment_checks import CHECKS, MakeEnvs
from inbounds.book.exercises.judging import Case, Judgement, judge_by_checks, judge_cases, judge_diagnosis
from inbounds.learning.families.policy import SATURATION_MARGIN

__all__ = ["at_bounds", "diagnosis", "own_environment", "value_under_a_clock"]


def at_bounds(function: Callable[..., Any]) -> Judgement:
    """Shares of executed actions at the lower and at the upper bound, for each dimension: `[2, A]`.

    Args:
        function: the reader's ``at_bounds(action, low, high)``, of arrays `[T, A]`, `[A]` and `[A]`.

    Example:
        >>> at_bounds(lambda action, low, high: np.stack([action <= low, action >= high]).mean(1))
        ✗ not yet: <lambda>: only exact hits are counted: allow a margin of 0.1 % of half the range
    """

    @functools.wraps(function)
    def of(action: NDArray[Any], low: NDArray[Any], high: NDArray[Any]) -> Any:
        return function(action.copy(), low.copy(), high.copy())

    def case(action: NDArray[Any], low: NDArray[Any], high: NDArray[Any]) -> Case:
        margin = SATURATION_MARGIN * (high - low) / 2

        def shares(lower: NDArray[Any], upper: NDArray[Any]) -> NDArray[Any]:
            return np.stack([lower, upper]).mean(1)

        expected = shares(action - low <= margin, high - action <= margin)
        unit = np.abs((action - (low + high) / 2) / ((high - low) / 2)) >= 1 - SATURATION_MARGIN
        mistakes = {
            "only exact hits are counted: allow a margin of 0.1 % of half the range": shares(
                action <= low, action >= high
            ),
            "the margin has no units: 0.001 of *half the range* of each dimension": shares(
                action - low <= SATURATION_MARGIN, high - action <= SATURATION_MARGIN
            ),
            "the margin is a share of the whole range, not of half of it": shares(
                action - low <= 2 * margin, high - action <= 2 * margin
            ),
            "both bounds are in one number: keep them apart, low first": unit.mean(0),
            "upper and lower bound have changed places: low first": expected[::-1],
            "the dimensions are pooled: one share for each": expected.mean(1),
            "that is a test for a box of [−1, 1]: this one has its own bounds": shares(
                action <= -1 + SATURATION_MARGIN, action >= 1 - SATURATION_MARGIN
            ),
        }
        return Case((action, low, high), expected, mistakes, hint="some share is wrong")

    rng = np.random.default_rng(0)
    low, high = np.array([-2.0, 0.0]), np.array([8.0, 1.0])
    clipped = np.clip(rng.normal([3, 0.2], [6, 0.5], (400, 2)), low, high)
    clipped[:40, 0], clipped[40:60, 0] = -1.9965, -1.9935  # inside the margin of 0.005, and a little beyond
    clipped[:30, 1], clipped[30:80, 1] = 0.9996, 0.9993  # likewise, of 0.0005
    wide = np.clip(rng.normal(0, 300, (150, 1)), -500, 200)
    cases = [
        case(clipped, low, high),
        replace(case(wide, np.array([-500.0]), np.array([200.0])), mistakes={}),
    ]
    return judge_cases(of, cases, "right, in any units")


def value_under_a_clock(function: Callable[..., Any]) -> Judgement:
    """Mean value that a critic learns if a clock of N steps is called termination; the reward is 1 in each step.

    Args:
        function: the reader's ``value_under_a_clock(gamma, steps)``.

    Example:
        >>> value_under_a_clock(lambda gamma, steps: 1 / (1 - gamma))
        ✗ not yet: <lambda>: that is the value without a clock
    """

    def case(gamma: float, steps: int) -> Case:
        left = np.array(
            [sum(gamma**t for t in range(k)) for k in range(1, steps + 1)]
        )  # k steps left, this one too
        endless = 1 / (1 - gamma)
        mistakes = {
            "that is the value without a clock": endless,
            "that is the value of an episode's first step: average over all N": left[-1],
            "one step too many is left: the last step has one reward, its own": (left * gamma + 1).mean(),
            "one step is missing: a step still earns its own reward": ((left - 1) / gamma).mean(),
            "that is the sum over the episode: divide by N": left.sum(),
            "that is the shortfall's share, not the value": 1 - left.mean() / endless,
        }
        return Case((gamma, steps), left.mean(), mistakes)

    return judge_cases(function, [case(0.97, 96), case(0.5, 4), case(0.99, 1000)], "right")


def own_environment(make: MakeEnvs) -> Judgement:
    """All checks of `inbounds.book.environment_checks`, on the reader's environment.

    Args:
        make: the reader's function (or class), which makes a vector environment for a number of seeds.

    Example:
        >>> own_environment(lambda num_envs: ...)
        … not answered: <lambda>: write it, and run this cell again
    """

    def answered() -> bool:
        return isinstance(make(1), VectorEnv)

    return judge_by_checks(make, CHECKS, answered, "your environment")


def diagnosis(answers: Mapping[str, Any], broken: Mapping[str, MakeEnvs]) -> Judgement:
    """Which check stops which broken environment, as the reader predicts it.

    Args:
        answers: the reader's, by environment: the name of the first check that fails.
        broken: what makes the broken environments, under the same names.

    Example:
        >>> diagnosis({"A": ...}, {"A": lambda num_envs: None})
        … not answered: diagnosis: name a check for every environment, and run this cell again
    """
    stopped_before = "an earlier check stops it"
    return judge_diagnosis(answers, broken, CHECKS, "environment", stopped_before, "it gets past that one")
