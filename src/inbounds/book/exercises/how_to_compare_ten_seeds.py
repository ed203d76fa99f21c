"""Graders of the chapter *How to compare ten seeds* (`judging` tells how one works)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from inbounds.book.exercises.judging import Case, Judgement, judge_cases

__all__ = ["adjust", "final_interval"]

Floats = NDArray[np.float64]


def adjust(function: Callable[..., Any]) -> Judgement:
    """Holm's adjusted p-values, in the order given; NaN for a test that could not be made."""

    def case(p_values: list[float]) -> Case:
        p = np.array(p_values)
        m, made = len(p), ~np.isnan(p)
        rank = np.array([1 + np.sum(p < x) + np.sum(p[:i] == x) for i, x in enumerate(p)])  # from 1

        def stepped(count: float) -> Floats:
            """Each p times how many are not smaller; the largest of those up to it."""
            raw = p * (count - rank + 1)
            return np.array([np.max(raw[made & (p <= x)]) if x == x else x for x in p])

        def capped(values: Floats) -> Floats:
            return np.where(made, np.minimum(values, 1), np.nan)

        expected = capped(stepped(m))
        mistakes = {
            "that is Bonferroni's correction: all are multiplied by their number": capped(p * m),
            "a p-value was adjusted to less than a smaller one before it: take the running maximum": capped(
                p * (m - rank + 1)
            ),
            "that is sorted: return the p-values in the order given": np.sort(expected),
            "a probability exceeds one: cap it": np.where(made, stepped(m), np.nan),
            "a test that could not be made must keep its place in the count": capped(stepped(made.sum())),
            "the smallest is to be multiplied by the largest factor: you sorted downwards": capped(p * rank),
            "that is Benjamini and Hochberg's: it bounds another error rate": _benjamini_hochberg(p, made),
        }
        return Case((p.copy(),), expected, mistakes)

    first = [0.004, 0.3, 0.011, 0.04, 0.0115, 0.2]
    missing = replace(case([0.02, math.nan, 0.001, 0.3, math.nan, 0.012]), hint="with missing tests (NaN)")
    cases = [case(first), case([0.6, 0.55, 0.01]), missing]
    return judge_cases(function, cases, "right: in order, never falling, and nobody leaves the count")


def _benjamini_hochberg(p: Floats, made: NDArray[np.bool_]) -> Floats:
    adjusted = np.full(len(p), np.nan)
    adjusted[made] = stats.false_discovery_control(p[made])
    return adjusted


def final_interval(function: Callable[..., Any]) -> Judgement:
    """Student's 95 % interval of the mean final return, from curves `[S, E]`."""

    def case(seeds: int, epochs: int) -> Case:
        rng = np.random.default_rng(seeds)
        curves = 100 * rng.normal(size=(seeds, 1)) + 30 * rng.normal(size=(seeds, epochs)) + np.arange(epochs)
        tail = curves[:, -(epochs // 10) :]
        result = tail.mean(1)

        def interval(numbers: Floats, ddof: int, quantile: float, root: bool = True) -> Floats:
            reach = quantile * numbers.std(ddof=ddof) / (np.sqrt(numbers.size) if root else 1)
            return numbers.mean() + np.array([-reach, reach])

        t, z, rounded = stats.t.ppf(0.975, seeds - 1), stats.norm.ppf(0.975), 1.96
        pooled = tail.ravel()
        expected = interval(result, 1, t)
        mistakes = {
            "all three errors are still there": interval(pooled, 0, rounded),
            "every epoch still counts as a seed": interval(pooled, 1, rounded),
            "every epoch still counts as a seed: average within a seed first": interval(
                pooled, 1, stats.t.ppf(0.975, pooled.size - 1)
            ),
            "every epoch counts as a seed: 1.96 was not the only trouble": interval(pooled, 0, t),
            "every epoch counts as a seed, although the quantile knows better": interval(pooled, 1, t),
            "two errors are left: the divisor of the variance, and the quantile": interval(
                result, 0, rounded
            ),
            "1.96 is the Normal's quantile; with so few seeds Student's is wanted": interval(
                result, 1, rounded
            ),
            "that is the Normal's quantile, 1.96 with more digits; with so few seeds Student's is wanted": interval(
                result, 1, z
            ),
            "the divisor of the variance is wrong, and the quantile is the Normal's": interval(result, 0, z),
            "every epoch still counts as a seed, and the quantile is the Normal's": interval(pooled, 1, z),
            "Student's quantile has n − 1 degrees of freedom, not n": interval(
                result, 1, stats.t.ppf(0.975, seeds)
            ),
            "the variance is divided by n: std has an argument ddof": interval(result, 0, t),
            "one tail holds 2.5 %: take the 97.5 % quantile": interval(
                result, 1, stats.t.ppf(0.95, seeds - 1)
            ),
            "that is where another seed would lie; of the mean: divide by √n": interval(
                result, 1, t, root=False
            ),
            "only the last epoch is used: take the last tenth": interval(curves[:, -1], 1, t),
            "all epochs are used: take the last tenth": interval(curves.mean(1), 1, t),
        }
        return Case((curves,), expected, mistakes, hint="the interval is wrong")

    return judge_cases(
        function, [case(10, 500), case(5, 40)], "right: one number per seed, n − 1, and Student's quantile"
    )
