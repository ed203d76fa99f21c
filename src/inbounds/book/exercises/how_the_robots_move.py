"""Graders of the page *How the robots move* (`judging` tells how one works)."""

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
