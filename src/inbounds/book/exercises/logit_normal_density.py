"""Graders of the chapter *The logit-normal density* (`judging` tells how one works)."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from scipy import integrate, stats

from inbounds.book.exercises.judging import Case, Judgement, judge_cases
from inbounds.distributions import LogitNormal

__all__ = ["entropy_by_quadrature", "log_prob_from_latent"]


def log_prob_from_latent(function: Callable[..., Any]) -> Judgement:
    """Judge the log-density of the action at ``g(latent)``, stable for large latents."""

    def case(latent: float, loc: float, scale: float, low: float, high: float, **known: Any) -> Case:
        arguments = tuple(torch.tensor(x, dtype=torch.float64) for x in (latent, loc, scale, low, high))
        normal = stats.norm.logpdf(latent, loc, scale)
        jacobian = -np.logaddexp(0.0, latent) - np.logaddexp(0.0, -latent)  # log s(z) + log s(−z)
        length = math.log(high - low)
        mistakes = {
            "the Jacobian is missing: that is the Gaussian's density at the latent": normal,
            "the sigmoid's derivative is missing; only the interval's length is there": normal - length,
            "the interval's length is missing: the density is for (0, 1)": normal - jacobian,
            "the Jacobian has the wrong sign: a density is *divided* by |da/dz|": normal + jacobian + length,
            "the interval's length has the wrong sign": normal - jacobian + length,
        }
        return Case(arguments, normal - jacobian - length, mistakes, **known)

    saturated = "at a latent of 40 the sigmoid is 1 to the last bit: use softplus or logsigmoid"
    overflow = "at a latent of −800 the exponential overflows: use softplus or logsigmoid"
    cases = [
        case(0.4, 0.1, 0.7, -1.0, 1.0),
        case(-1.3, 0.5, 2.0, 0.0, 5.0),
        case(40.0, 38.0, 2.0, -1.0, 1.0, hint=saturated),
        case(-800.0, -790.0, 5.0, 0.0, 2.0, hint=overflow),
    ]
    return judge_cases(function, cases, "right, at the centre and far out")


def entropy_by_quadrature(function: Callable[..., Any]) -> Judgement:
    """Judge the differential entropy on (low, high)."""
    too_few = "the value is wrong (from the third digit on? samples give no more: sum over a grid)"

    def case(loc: float, scale: float, low: float, high: float) -> Case:
        def surprise(z: float) -> float:
            log_slope = -np.logaddexp(0.0, z) - np.logaddexp(0.0, -z) + math.log(high - low)
            return float(stats.norm.pdf(z, loc, scale) * (log_slope - stats.norm.logpdf(z, loc, scale)))

        expected = integrate.quad(surprise, loc - 12 * scale, loc + 12 * scale, epsabs=1e-12, limit=200)[0]
        gaussian = stats.norm.entropy(loc, scale)
        at_mean = loc - 2 * np.logaddexp(0.0, loc)
        mistakes = {
            "that is the Gaussian's entropy: entropy changes under the squashing": gaussian,
            "the interval's length is missing: add log(high − low)": expected - math.log(high - low),
            "the sign is wrong: entropy is minus the expected log-density": -expected,
            "that has both errors yet: softplus of the mean is not the mean of softplus, and a length is missing": (
                gaussian + at_mean
            ),
            "that takes softplus at the mean of z: average it over z instead": (
                gaussian + at_mean + math.log(high - low)
            ),
        }
        return Case((loc, scale, low, high), expected, mistakes, hint=too_few, rtol=1e-5)

    cases = [case(0.0, 1.0, 0.0, 3.0), case(1.5, 0.4, -1.0, 1.0), case(-0.5, 2.7, -1.0, 1.0)]
    reference = LogitNormal(torch.tensor(0.0), torch.tensor(1.0), 0.0, 3.0).entropy().item()
    return judge_cases(
        function, cases, f"right (LogitNormal.entropy() agrees: {reference:.4f} nats in the first case)"
    )
