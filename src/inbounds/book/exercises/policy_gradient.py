"""Graders of the chapter *The policy gradient* (`judging` tells how one works)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from inbounds.book.exercises.judging import Case, Judgement, judge_cases

__all__ = ["lambda_returns", "leave_one_out_gradient"]


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


def lambda_returns(function: Callable[..., Any]) -> Judgement:
    """The λ-returns of a rollout in which episodes end, are cut off, and go on."""
    rng = np.random.default_rng(0)

    def case(ends: dict[int, str], steps: int, gamma: float, lam: float) -> Case:
        reward, next_value = rng.normal(size=(2, steps)) + 1.0
        terminated, truncated = (
            np.array([ends.get(t) == kind for t in range(steps)]) for kind in ("terminated", "truncated")
        )
        arguments = (reward, next_value, terminated, truncated, gamma, lam)

        def wrong(**flaws: bool) -> np.ndarray:
            return _forward(*arguments, **flaws)

        mistakes = {
            "both errors are still there: a cut is no end, and neither is the rollout's last step": wrong(
                cut_ends=True, last_ends=True
            ),
            "a truncated step still counts as the end of the world: bootstrap there": wrong(cut_ends=True),
            "the rollout's last step is cut off too: begin with its next value, not with 0": wrong(
                last_ends=True
            ),
            "a *terminated* step has nothing after it: no bootstrap there": wrong(end_bootstraps=True),
            "returns leak from one episode into the one before: start afresh at a truncated step": wrong(
                leaks=True
            ),
        }
        return Case(arguments, wrong(), mistakes)

    cases = [
        case({2: "truncated"}, 6, 0.9, 0.8),  # first, because it tells one error from two
        case({2: "terminated"}, 6, 0.9, 0.8),
        case({}, 5, 0.9, 0.8),
        case({1: "truncated", 4: "terminated", 8: "truncated"}, 12, 0.97, 0.95),
        case({3: "truncated"}, 8, 0.9, 1.0),
    ]
    return judge_cases(function, cases, "right: ends end, cuts do not")


def _forward(
    reward: Any,
    next_value: Any,
    terminated: Any,
    truncated: Any,
    gamma: float,
    lam: float,
    *,
    cut_ends: bool = False,
    last_ends: bool = False,
    end_bootstraps: bool = False,
    leaks: bool = False,
) -> np.ndarray:
    """The λ-return by its definition, a weighted mean of k-step returns; flaws on demand."""
    steps = len(reward)
    ahead = np.where(terminated & (not end_bootstraps), 0.0, next_value)
    if cut_ends:
        ahead = np.where(truncated, 0.0, ahead)
    if last_ends and not terminated[-1] and not truncated[-1]:
        ahead[-1] *= 1 - lam  # (1 − λ) V + λ·0, as a recursion that starts with zero has it
    stops = terminated | (truncated & (not leaks))
    returns = np.zeros(steps)
    for t in range(steps):
        last = next((k for k in range(t, steps) if stops[k]), steps - 1)
        sums = [
            sum(gamma ** (k - t) * reward[k] for k in range(t, j + 1)) + gamma ** (j - t + 1) * ahead[j]
            for j in range(t, last + 1)
        ]
        weights = [(1 - lam) * lam ** (j - t) for j in range(t, last)] + [lam ** (last - t)]
        returns[t] = np.dot(weights, sums)
    return returns
