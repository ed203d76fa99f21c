"""Graders of the page *Mean, mode and moments of a logit-normal* (`judging` tells how one works)."""

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy import integrate, stats
from scipy.special import expit

from inbounds.book.exercises.judging import Case, Judgement, judge_cases

__all__ = ["action_variance"]


def action_variance(function: Callable[..., Any]) -> Judgement:
    """Judge the variance of a logit-normal action on (low, high)."""
    too_few = "the value is wrong (from the third digit on? samples give no more: sum over a grid)"

    def case(loc: float, scale: float, low: float, high: float) -> Case:
        def moment(power: int) -> float:
            """Of the sigmoid, by adaptive quadrature: not the reader's formula."""
            return float(
                integrate.quad(
                    lambda t: stats.norm.pdf(t) * expit(loc + scale * t) ** power,
                    -12,
                    12,
                    epsabs=1e-13,
                    limit=200,
                )[0]
            )

        mean, length = moment(1), high - low
        unit = moment(2) - mean**2
        mistakes = {
            "that is the variance on (0, 1): an interval of length L multiplies it by L²": unit,
            "an interval of length L multiplies a variance by L², not by L": unit * length,
            "that is the standard deviation: square it": np.sqrt(unit) * length,
            "the slope of the mean is missing: Var = m(1 − m) − m′": mean * (1 - mean) * length**2,
            "that is the slope's share, m′: the variance is m(1 − m) − m′": (mean * (1 - mean) - unit)
            * length**2,
            "that is the second moment of the sigmoid, scaled: subtract the squared mean": moment(2)
            * length**2,
            "that is the Gaussian's variance, of the latent": scale**2,
            "that is the first-order copy, σ g′(μ) squared: average over z": (
                scale * length * expit(loc) * expit(-loc)
            )
            ** 2,
        }
        return Case((loc, scale, low, high), unit * length**2, mistakes, hint=too_few, rtol=1e-6)

    cases = [case(0.4, 0.7, 0.0, 3.0), case(-1.0, 1.3, -1.0, 1.0), case(0.7, float(np.e), -0.4, 0.4)]
    return judge_cases(function, cases, "right, from narrow to wide")
