"""Graders of the chapter *Why: inside the policies* (`judging` tells how one works)."""

from collections.abc import Callable
from typing import Any

import numpy as np

from inbounds.book.exercises.judging import Case, Judgement, judge_cases

_EPOCHS = {
    "two epochs, one of many short episodes": ([20.0, 2.0], [100.0, 2000.0]),
    "an epoch in which no episode ended": ([4.0, 0.0, 1.0], [50.0, np.nan, 3000.0]),
    "many epochs": (list(np.arange(1.0, 13.0)), list(1000.0 / np.arange(1.0, 13.0) ** 2)),
}


def taken_apart(function: Callable[..., Any]) -> Judgement:
    """Steps per episode and reward per step of one seed, from what its epochs recorded."""
    cases = []
    for about, (ended, returns) in _EPOCHS.items():
        episodes, means, steps = np.array(ended), np.array(returns), 2048
        rows = [(n, mean) for n, mean in zip(ended, returns, strict=True) if n]
        count, total = sum(n for n, _ in rows), sum(n * mean for n, mean in rows)
        everything = steps * len(ended)
        by_epoch = [(steps / n, n * mean / steps) for n, mean in rows]
        mistakes = {
            "an epoch without an episode has a return of NaN: leave it out of the sum": (
                (everything / count, np.nan) if len(rows) < len(ended) else (np.nan, np.nan)
            ),
            "an epoch with one episode counts there like one with twenty: add first, divide once": tuple(
                float(np.mean(column)) for column in zip(*by_epoch, strict=True)
            ),
            "the other way about: steps per episode first, then reward per step": (
                total / everything,
                everything / count,
            ),
            "the second is the reward per step, not per episode": (everything / count, total / count),
            "the steps of all epochs, not of one": (steps / count, total / steps),
        }
        hint = f"{about}: all steps over all episodes, and all that was earned over all steps"
        cases.append(
            Case(
                (episodes, means, steps), (everything / count, total / everything), mistakes, hint, rtol=1e-9
            )
        )
    return judge_cases(function, cases, "sums first, then one division")


def ratio_of_lengths(function: Callable[..., Any]) -> Judgement:
    """Ratio of the geometric means of two groups of lengths."""
    rng = np.random.default_rng(0)

    def case(first: np.ndarray, second: np.ndarray, hint: str) -> Case:
        right = float(np.prod(first ** (1 / len(first))) / np.prod(second ** (1 / len(second))))
        arithmetic = float(first.mean() / second.mean())
        known = {
            "those are arithmetic means, undone with the wrong base": 10 ** np.log(arithmetic),
            "those are arithmetic means: one long update decides them": arithmetic,
            "natural logarithms are undone by the exponential, not by a power of ten": 10 ** np.log(right),
            "that is the logarithm of the ratio": np.log(right),
            "the second over the first": 1 / right,
        }
        mistakes = {said: float(wrong) for said, wrong in known.items() if not np.isclose(wrong, right)}
        return Case((first, second), right, mistakes, hint, rtol=1e-9)

    cases = [
        case(
            np.array([0.01, 0.1, 1.0]),
            np.array([0.02, 0.02, 0.02]),
            "exp of the difference of mean logarithms",
        ),
        case(10 ** rng.normal(-2, 0.5, 10), 10 ** rng.normal(-1, 0.2, 10), "ten lengths each, far apart"),
    ]
    return judge_cases(function, cases, "geometric means, and one base of logarithms")
