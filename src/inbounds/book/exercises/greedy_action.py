"""Grader of the chapter *The greedy action* (`judging` tells how one works)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy import integrate, stats
from scipy.special import expit

from inbounds.book.exercises.judging import Case, Judgement, judge_cases

__all__ = ["mean_action"]


def mean_action(function: Callable[..., Any]) -> Judgement:
    """The mean of a logit-normal action on (low, high)."""

    def case(loc: float, scale: float, low: float, high: float) -> Case:
        fraction = integrate.quad(
            lambda t: stats.norm.pdf(t) * expit(loc + scale * t), -10, 10, epsabs=1e-13, limit=200
        )[0]
        length = high - low
        nodes, weights = np.polynomial.hermite.hermgauss(100)
        narrow = float(np.sum(weights * expit(loc + scale * nodes)))
        unscaled = float(np.sum(weights * expit(loc + np.sqrt(2) * scale * nodes)))
        mistakes = {
            "that is the median: average the squashed latents, do not squash the average": low
            + length * expit(loc),
            "both errors are still there: look at the weight function of the rule": low + length * narrow,
            "the nodes are for exp(−x²): a standard Gaussian's are √2 times as far out": low
            + length * narrow / np.sqrt(np.pi),
            "the weights add up to √π, not to one": low + length * unscaled,
            "the box is missing: stretch the fraction to (low, high)": fraction,
            "the lower bound is missing": length * fraction,
        }
        return Case((loc, scale, low, high), low + length * fraction, mistakes, rtol=1e-5)

    cases = [case(0.7, 0.9, -1.0, 1.0), case(-0.4, 1.5, 0.0, 3.0), case(2.0, 0.5, -0.4, 0.4)]
    return judge_cases(function, cases, "right, on every box")
