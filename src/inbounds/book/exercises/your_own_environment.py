"""Graders of the chapter *Your own environment* (`judging` tells how one works)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from inbounds.book.exercises.checks.environment import CHECKS, MakeEnvs
from inbounds.book.exercises.judging import Case, Judgement, judge_by_checks, judge_cases, judge_diagnosis

__all__ = ["diagnosis", "own_environment", "value_under_a_clock"]


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
            "that is the share of the value that is learned: return the value": left.mean() / endless,
        }
        return Case((gamma, steps), left.mean(), mistakes)

    return judge_cases(function, [case(0.97, 96), case(0.5, 4), case(0.99, 1000)], "right")


def own_environment(make: MakeEnvs) -> Judgement:
    """All checks of `inbounds.book.exercises.checks.environment`, on the reader's environment.

    Args:
        make: the reader's function (or class), which makes a vector environment for a number of seeds.

    Example:
        >>> own_environment(lambda num_envs: ...)
        … not answered: <lambda>: write it, and run this cell again
    """

    def answered() -> bool:
        made = make(1)
        return made is not None and made is not ...

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
