"""Graders of the chapter *KL invariance* (`judging` tells how one works)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy import stats
from scipy.special import logit

from inbounds.book.exercises.judging import Case, Judgement, judge_cases

__all__ = ["mean_kl", "squashed_score"]


def squashed_score(function: Callable[..., Any]) -> Judgement:
    """The gradient of the action's log-density with respect to (μ, log σ), from the action."""

    def case(fraction: float, loc: float, log_scale: float, low: float, high: float) -> Case:
        action = low + fraction * (high - low)
        z, scale = float(logit(fraction)), float(np.exp(log_scale))

        def score(at: float) -> np.ndarray:
            """Central differences of the Gaussian's log-density: not the reader's formula."""
            h = 1e-5
            by_loc = stats.norm.logpdf(at, loc + h, scale) - stats.norm.logpdf(at, loc - h, scale)
            wider, narrower = scale * np.exp(h), scale * np.exp(-h)
            by_scale = stats.norm.logpdf(at, loc, wider) - stats.norm.logpdf(at, loc, narrower)
            return np.array([by_loc, by_scale]) / (2 * h)

        right = score(z)
        slope = np.array([np.tanh(z / 2), 0.0])  # of the log-Jacobian in z: no parameter is in it
        mistakes = {
            "that is the Gaussian's score at the *action*: go back to the latent first": score(action),
            "that is the score at logit(action), which forgets the box: rescale to (0, 1) first": score(
                float(logit(action)) if 0 < action < 1 else np.nan
            ),
            "2 artanh(action) is the latent on [−1, 1] only: rescale this box to (0, 1), then take the logit": score(
                float(2 * np.arctanh(action)) if abs(action) < 1 else np.nan
            ),
            "the derivative is with respect to σ, not log σ: multiply it by σ": right / [1.0, scale],
            "log_scale is log σ: take its exponential first": (
                np.array([(z - loc) / log_scale**2, (z - loc) ** 2 / log_scale**2 - 1])
                if log_scale
                else np.full(2, np.nan)
            ),
            "the sign is wrong: that is the gradient of minus the log-density": -right,
            "the Jacobian's slope does not belong there: it does not contain the parameters": right + slope,
            "the order is (μ, log σ)": right[::-1],
        }
        return Case((action, loc, log_scale, low, high), right, mistakes, rtol=1e-5)

    cases = [
        case(0.7, 0.2, -0.4, -1.0, 1.0),
        case(0.35, -1.0, 0.6, 0.0, 1.0),
        case(0.05, 0.5, 0.0, -0.4, 2.0),
    ]
    return judge_cases(function, cases, "right: the squash has no say in the score")


def mean_kl(function: Callable[..., Any]) -> Judgement:
    """The mean over states of KL(old‖new) of policies with several action dimensions."""
    rng = np.random.default_rng(0)

    def case(states: int, act_dim: int) -> Case:
        loc_old, loc_new = rng.normal(size=(2, states, act_dim))
        scale_old, scale_new = rng.uniform(0.5, 2.0, size=(2, states, act_dim))
        forward = _kl(loc_old, scale_old, loc_new, scale_new)
        backward = _kl(loc_new, scale_new, loc_old, scale_old)
        mistakes = {
            "both errors are still there: new‖old, and averaged over action dimensions": backward.mean(),
            "that is KL(new‖old): the first argument draws, the second is compared": backward.sum(1).mean(),
            "that is averaged over action dimensions, where divergences add: sum over them": forward.mean(),
            "that is summed over states: take their mean": forward.sum(),
            "one number per state: take their mean": forward.sum(1),
            "one number per state and dimension: sum over dimensions, then take the mean": forward,
        }
        return Case((loc_old, scale_old, loc_new, scale_new), forward.sum(1).mean(), mistakes)

    return judge_cases(
        function, [case(5, 3), case(1, 17)], "right: summed over dimensions, averaged over states"
    )


def _kl(loc: Any, scale: Any, loc_new: Any, scale_new: Any) -> np.ndarray:
    """KL of two Normals, elementwise, as the expectation of the log-ratio by Gauss–Hermite (exact: degree two)."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(3)
    z = loc[..., None] + scale[..., None] * nodes
    log_ratio = stats.norm.logpdf(z, loc[..., None], scale[..., None]) - stats.norm.logpdf(
        z, loc_new[..., None], scale_new[..., None]
    )
    return np.asarray((weights * log_ratio).sum(-1) / np.sqrt(2 * np.pi))
