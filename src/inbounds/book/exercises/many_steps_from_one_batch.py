"""Graders of the chapter *Many steps from one batch* (`judging` tells how one works)."""

from __future__ import annotations

import functools
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import torch
from scipy.special import logsumexp

from inbounds.book.exercises.judging import Case, Judgement, judge_cases

__all__ = ["effective_sample_size", "surrogate", "surrogate_of"]


def effective_sample_size(function: Callable[..., Any]) -> Judgement:
    """(Σ r)² / Σ r² from log-ratios, without overflow."""

    def case(log_ratio: np.ndarray, **known: Any) -> Case:
        n = len(log_ratio)
        right = float(np.exp(2 * logsumexp(log_ratio) - logsumexp(2 * log_ratio)))
        with np.errstate(over="ignore", invalid="ignore"):
            ratio = np.exp(log_ratio)
            mistakes = {
                "that is the share n_eff/n: multiply by n": right / n,
                "that is n divided by it: the second moment of the ratios": n / right,
                "it must not change when all ratios are multiplied by a number: divide by the sum first": n
                * ratio.mean() ** 2,
                "the ratios are squared before they are summed, twice": ratio.sum() / np.sum(ratio**2),
                "those are the log-ratios' sums: exponentiate first": log_ratio.sum() ** 2
                / np.sum(log_ratio**2),
                "the variance is taken about the mean: it is the second moment that counts": n
                / max(ratio.var() / ratio.mean() ** 2, 1e-300)
                if np.isfinite(ratio).all()
                else np.nan,
            }
        return Case((log_ratio,), right, {k: v for k, v in mistakes.items() if np.isfinite(v)}, **known)

    rng = np.random.default_rng(0)
    draws = rng.normal(-0.1, 0.5, 50)
    overflow = "a log-ratio of 1000 overflows: subtract the largest before you exponentiate"
    underflow = "log-ratios of −1000 underflow: subtract the largest before you exponentiate"
    cases = [
        case(draws),
        case(np.zeros(7)),
        case(draws + 1000.0, hint=overflow),
        case(draws - 1000.0, hint=underflow),
        case(np.array([0.0, -3.0, 900.0]), hint=overflow),
    ]
    return judge_cases(function, cases, "right, for any size of the ratios")


def surrogate(function: Callable[..., Any]) -> Judgement:
    """The growing program's `surrogate`: its value, and the gradient that reaches the policy."""
    rng, swapped = np.random.default_rng(0), []

    @functools.wraps(function)
    def value_and_slope(
        shift: float, log_prob: torch.Tensor, old: torch.Tensor, advantage: torch.Tensor
    ) -> Any:
        at = torch.tensor(shift, dtype=torch.float64, requires_grad=True)
        batch = SimpleNamespace(obs=torch.zeros(len(log_prob), 3), latent=torch.zeros(len(log_prob), 2))

        def present(obs: Any, latent: Any) -> torch.Tensor:
            swapped.extend([1] if obs is batch.latent or latent is batch.obs else [])
            return log_prob + at * torch.arange(len(log_prob))

        policy = SimpleNamespace(log_prob=present)
        found = function(policy, batch, advantage, old)
        if not isinstance(found, torch.Tensor) or found.ndim:
            return found
        slope = torch.autograd.grad(found, at, allow_unused=True)[0] if found.requires_grad else None
        return [float(found.detach()), 0.0 if slope is None else float(slope)]

    def case(steps: int) -> Case:
        log_prob, old, advantage = rng.normal(size=(3, steps))
        step, shift = np.arange(steps), 0.1
        ratio = np.exp(log_prob + shift * step - old)

        def both(weight: np.ndarray, slope: np.ndarray) -> list[float]:
            return [float(np.mean(weight * advantage)), float(np.mean(slope * advantage))]

        right = both(ratio, ratio * step)
        flat = np.sign(advantage) * (ratio - 1) > 0.2
        capped = np.where(flat, 1 + 0.2 * np.sign(advantage), ratio)
        mistakes = {
            "that is PPO's, clipped at 0.2: nothing is clipped here": both(
                capped, np.where(flat, 0.0, ratio * step)
            ),
            "no gradient reaches the policy: nothing of the new log-probability may be detached": [
                right[0],
                0.0,
            ],
            "the log-ratio is not exponentiated": both(np.log(ratio), step),
            "a ratio of *densities*: subtract the log-densities, then take the exponential": both(
                (log_prob + shift * step) / old, step / old
            ),
            "a *quotient* of densities: subtract before you take the exponential, not after": both(
                np.exp(log_prob + shift * step) - np.exp(old), np.exp(log_prob + shift * step) * step
            ),
            "the mean of the products, not the product of the means": [
                float(ratio.mean() * advantage.mean()),
                float((ratio * step).mean() * advantage.mean()),
            ],
            "the advantages are normalised in the update: leave them as they are here": [
                float(np.mean(each * (advantage - advantage.mean()) / (advantage.std(ddof=1) + 1e-8)))
                for each in (ratio, ratio * step)
            ],
            "old and new are swapped": both(1 / ratio, -step / ratio),
            "the sign is wrong: this is to be ascended": [-x for x in right],
            "that is the sum over the batch: take its mean": [steps * x for x in right],
            "return one number: the mean over the batch": ratio * advantage,
            "that is the objective of REINFORCE, without a ratio": both(log_prob + shift * step, step),
        }
        arguments = (shift, *map(torch.from_numpy, (log_prob, old, advantage)))
        return Case(arguments, right, mistakes)

    verdict = judge_cases(value_and_slope, [case(5), case(40)], "right: ratio times advantage, averaged")
    if swapped:
        return Judgement(verdict.exercise, False, "log_prob takes batch.obs first, then batch.latent")
    return verdict


def surrogate_of(function: Callable[..., Any]) -> Judgement:
    """The surrogate of a Gaussian policy with several action dimensions."""
    rng = np.random.default_rng(0)

    def case(steps: int, act_dim: int) -> Case:
        old_loc, loc = rng.normal(0, 0.5, (2, steps, act_dim))
        old_scale, scale = rng.uniform(0.7, 1.4, (2, steps, act_dim))
        latent = old_loc + old_scale * rng.standard_normal((steps, act_dim))
        advantage = rng.normal(size=steps)

        def log_ratio(denominator: np.ndarray) -> np.ndarray:
            new, old = (latent - loc) / scale, (latent - old_loc) / denominator
            return (old**2 - new**2) / 2 - np.log(scale / denominator)

        def weighted(ratio: np.ndarray) -> float:
            return float(ratio @ advantage / steps)

        right, same_scale = log_ratio(old_scale), log_ratio(scale)
        mistakes = {
            "both errors are still there: the old law's scale, and the mean over dimensions": weighted(
                np.exp(same_scale).mean(1)
            ),
            "the ratio of a vector is the product over its dimensions, not the mean": weighted(
                np.exp(right).mean(1)
            ),
            "sum the log-ratios, do not average them: densities of coordinates multiply": weighted(
                np.exp(right.mean(1))
            ),
            "the old law has the old scale": weighted(np.exp(same_scale.sum(1))),
            "that is the sum of the dimensions' ratios: multiply them": weighted(np.exp(right).sum(1)),
            "old and new are swapped": weighted(np.exp(-right.sum(1))),
            "that is the sum over steps: take their mean": steps * weighted(np.exp(right.sum(1))),
            "the log-ratio is not exponentiated": weighted(right.sum(1)),
        }
        return Case(
            (loc, scale, old_loc, old_scale, latent, advantage), weighted(np.exp(right.sum(1))), mistakes
        )

    return judge_cases(
        function, [case(5, 3), case(40, 6), case(3, 1)], "right: one ratio per step, of two whole laws"
    )
