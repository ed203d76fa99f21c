"""Grader of the page *Three centres* (`judging` tells how one works)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from scipy.special import expit

from inbounds.book.exercises.judging import Case, Judgement, judge_cases
from inbounds.distributions import LogitNormal

__all__ = ["mode_gradient"]


def mode_gradient(function: Callable[..., Any]) -> Judgement:
    """The derivatives of the logit-normal's mode with respect to μ and σ."""

    def case(loc: float, scale: float, low: float, high: float) -> Case:
        parameters = torch.tensor([loc, scale], dtype=torch.float64, requires_grad=True)
        law = LogitNormal(parameters[0], parameters[1], low, high)
        (right,) = torch.autograd.grad(law.mode, parameters)
        expected, z = right.numpy(), float(law.mode_latent.detach())
        squash = (high - low) * expit(z) * expit(-z)  # g'(z): from the latent's mode to the action's
        at_median = (high - low) * expit(loc) * expit(-loc)
        bend = 1 - 2 * scale**2 * expit(z) * expit(-z)
        mistakes = {
            "those are the slopes of the *latent* mode: multiply by the squash's slope there": expected
            / squash,
            "the denominator is missing: σ² tanh(z/2) depends on z too": expected * bend,
            "the squash's slope belongs at the mode's latent, not at μ": expected / squash * at_median,
            "the second number is with respect to σ², not σ: multiply it by 2σ": expected / [1.0, 2 * scale],
            "the interval's length is missing": expected / (high - low),
            "those are the slopes of the median": np.array([at_median, 0.0]),
            "that is the lower mode: the highest lies on μ's side of zero": _lower_mode_gradient(
                loc, scale, low, high
            ),
        }
        return Case((loc, scale, low, high), expected, mistakes, rtol=1e-5)

    cases = [case(0.3, 0.8, -1.0, 1.0), case(-1.2, 1.3, 0.0, 10.0), case(-0.1, 2.2, -0.4, 0.4)]
    return judge_cases(function, cases, "right, on both sides of zero and with two peaks")


def _lower_mode_gradient(loc: float, scale: float, low: float, high: float) -> np.ndarray:
    """Slopes of the stationary point that Newton finds from the wrong side; NaN where there is none."""
    z = -np.sign(loc) * scale**2
    for _ in range(100):
        tanh = np.tanh(z / 2)
        bend = 1 - scale**2 / 2 * (1 - tanh**2)
        z -= (z - loc - scale**2 * tanh) / bend
    if z * loc > 0 or abs(z - loc - scale**2 * np.tanh(z / 2)) > 1e-9:
        return np.full(2, np.nan)
    squash = (high - low) * expit(z) * expit(-z)
    bend = 1 - scale**2 / 2 * (1 - np.tanh(z / 2) ** 2)
    return np.array([1.0, 2 * scale * np.tanh(z / 2)]) * squash / bend
