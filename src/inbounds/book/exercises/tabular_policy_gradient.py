"""Graders of the page *The policy gradient on six cells* (`judging` tells how one works)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from inbounds.book.exercises.judging import Case, Judgement, judge_cases

__all__ = ["leave_one_out_gradient"]


def leave_one_out_gradient(function: Callable[..., Any]) -> Judgement:
    """The REINFORCE gradient in one state, with respect to (μ, log σ), each draw against the mean of the others."""
    rng = np.random.default_rng(0)

    def case(n: int, loc: float, log_scale: float) -> Case:
        scale = np.exp(log_scale)
        latent, returns = rng.normal(loc, scale, n), rng.normal(5.0, 2.0, n)
        u = (latent - loc) / scale
        score = np.stack([u / scale, u**2 - 1])  # [2, n]
        # Over pairs: Σ (score_i − score_j)(R_i − R_j) / 2n(n − 1), which needs no baseline at all.
        pairs = (score[:, :, None] - score[:, None]) * (returns[:, None] - returns)
        right = pairs.sum((1, 2)) / (2 * n * (n - 1))
        others = returns.sum() - returns
        mistakes = {
            "each return is compared with a mean that contains it: leave its own out": right * (n - 1) / n,
            "the baseline is missing: subtract the mean of the other returns": (score * returns).mean(1),
            "that is the sum over the draws: take their mean": right * n,
            "the second entry is the derivative in σ; in log σ it is σ times that": right / [1.0, scale],
            "the first entry lacks a factor 1/σ": right * [scale, 1.0],
            "the sign is wrong: return the direction of ascent": -right,
            "the others are n − 1, not n: divide their sum by that": (score * (returns - others / n)).mean(1),
            "the scores are averaged before they are weighed": score.mean(1)
            * (returns - returns.mean()).mean(),
        }
        return Case((latent, returns, loc, log_scale), right, mistakes)

    cases = [case(4, 0.3, -0.5), case(2, -1.0, 0.4), case(64, 0.0, 0.2)]
    return judge_cases(function, cases, "right: no return is in its own baseline")
