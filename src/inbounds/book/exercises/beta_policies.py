"""Graders of the chapter *Beta policies* (`judging` tells how one works)."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from scipy import special

from inbounds.book.exercises.judging import Case, Judgement, judge_cases

__all__ = ["match_moments", "safe_beta_kl"]

NO_POLICY = math.nan
"""What stands for the reader's None, which the judge would take for an exercise not answered."""


def match_moments(function: Callable[..., Any]) -> Judgement:
    """α and β of a Beta policy from its mean and standard deviation; None where no policy has them.

    Args:
        function: the reader's ``match_moments(mean, std, low, high, cap)``.

    Example:
        >>> match_moments(lambda mean, std, low, high, cap: ...)
        … not answered: <lambda>: write it, and run this cell again
    """

    def concentrations(m: float, v: float) -> tuple[float, float]:
        # The fraction's raw moments E[x], E[x²] → α, by E[x²]/E[x] = (α + 1)/(ν + 1).
        second = v / m + m
        alpha = m * (1 - second) / (second - m)
        return alpha, alpha * (1 - m) / m

    def attempt(mean: float, std: float, low: float, high: float, cap: float) -> Any:
        answer = function(mean, std, low, high, cap)
        return NO_POLICY if answer is None else answer

    def possible(mean: float, std: float, low: float, high: float, cap: float = 80.0) -> Case:
        m, v = (mean - low) / (high - low), (std / (high - low)) ** 2
        alpha, beta = concentrations(m, v)
        unscaled = concentrations(m, std**2)
        total = m * (1 - m) / v
        mistakes = {
            "the parameters have changed places: α pulls towards high": (beta, alpha),
            "the standard deviation is in units of the action: divide it by the interval's length": unscaled,
            "the variance is m(1 − m)/(ν + 1), not m(1 − m)/ν": (m * total, (1 - m) * total),
            "that takes the standard deviation for the variance": concentrations(m, std / (high - low)),
            "you refuse a mean and a spread that a policy can have": NO_POLICY,
        }
        return Case((mean, std, low, high, cap), (alpha, beta), mistakes, hint="wrong α or β")

    def refused(mean: float, std: float, low: float, high: float, why: str, cap: float = 80.0) -> Case:
        given = concentrations((mean - low) / (high - low), (std / (high - low)) ** 2)
        return Case((mean, std, low, high, cap), NO_POLICY, {why: given}, hint="this should be None")

    too_wide = "one of the parameters would be below 1 here: return None"
    too_narrow = "one of the parameters would be above the cap here: return None"
    cases = [
        possible(0.2, 0.1, 0.0, 0.5),
        possible(0.3, 0.2, -1.0, 1.0),
        refused(0.9, 0.3, -1.0, 1.0, too_wide),
        refused(-0.9, 0.3, -1.0, 1.0, too_wide),  # the other parameter
        refused(0.0, 0.01, -1.0, 1.0, too_narrow),
        refused(0.8, 0.05, -1.0, 1.0, too_narrow),  # α alone
        refused(-0.8, 0.05, -1.0, 1.0, too_narrow),  # β alone
        refused(0.3, 0.2, -1.0, 1.0, "the cap is an argument: this one is 10", cap=10.0),
        possible(0.0, 0.05, -1.0, 1.0, cap=300.0),
        possible(4.9, 0.09, 0.0, 5.0),
    ]
    attempt.__name__ = getattr(function, "__name__", "match_moments")
    return judge_cases(attempt, cases, "right, and it knows what a Beta policy cannot do")


def safe_beta_kl(function: Callable[..., Any]) -> Judgement:
    """KL(old‖new) of two Betas for float32 parameters, where the closed form cancels.

    Args:
        function: the reader's ``safe_beta_kl(alpha, beta, alpha_new, beta_new)``, of tensors.

    Example:
        >>> safe_beta_kl(lambda *four: four[0])  # doctest: +ELLIPSIS
        ✗ not yet: <lambda>: ...
    """

    def case(rows: list[list[float]], hint: str, rtol: float) -> Case:
        four = torch.tensor(rows, dtype=torch.float32).T
        exact, swapped = double_kl(*four), double_kl(*four[[2, 3, 0, 1]])
        naive = float32_kl(*four)
        mistakes = {
            "old and new have changed places: that is KL(new‖old)": swapped,
            "single precision cancels here: evaluate log-gamma and digamma in double": naive,
            "clamping hides the cancellation, it does not cure it": np.maximum(naive, 0),
            "that is minus the divergence": -exact,
        }
        return Case(tuple(four), exact, mistakes, hint=hint, rtol=rtol)

    def returns_float32(*four: torch.Tensor) -> Any:
        answer = function(*four)
        if isinstance(answer, torch.Tensor) and answer.dtype != torch.float32:
            raise TypeError(f"the result has the type {answer.dtype}; return the type of the arguments")
        return answer

    cancelled = "it is not accurate to single precision where α and β are large and the step is small"
    cases = [
        case([[2.0, 3.0, 4.0, 2.5], [1.5, 1.2, 1.1, 6.0]], "wrong even for small parameters", 1e-4),
        case([[79.0, 70.0, 79.5, 70.0], [60.0, 75.0, 60.0, 75.5], [80.0, 80.0, 79.0, 79.0]], cancelled, 1e-4),
    ]
    returns_float32.__name__ = getattr(function, "__name__", "safe_beta_kl")
    return judge_cases(returns_float32, cases, "right, also where single precision has nothing left")


def double_kl(alpha: Any, beta: Any, alpha_new: Any, beta_new: Any) -> Any:
    """KL(old‖new) in nats, in double precision: a difference of log B and a tangent.

    Example:
        >>> round(float(double_kl(40, 40, 80, 80)), 4)
        0.155
    """
    a, b, c, d = (np.asarray(x, dtype=np.float64) for x in (alpha, beta, alpha_new, beta_new))
    rise = special.betaln(c, d) - special.betaln(a, b)
    tangent = (c - a) * (special.digamma(a) - special.digamma(a + b))
    tangent += (d - b) * (special.digamma(b) - special.digamma(a + b))
    return rise - tangent


def float32_kl(alpha: torch.Tensor, beta: torch.Tensor, *new: torch.Tensor) -> np.ndarray:
    """The closed form as it stands in the chapter, in the type of its arguments: what cancels.

    Example:
        >>> one = torch.ones(1)
        >>> float32_kl(one, one, one, one).tolist()
        [0.0]
    """
    alpha_new, beta_new = new

    def log_beta(a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
        return torch.lgamma(a) + torch.lgamma(b) - torch.lgamma(a + b)

    total = alpha + beta
    value = log_beta(alpha_new, beta_new) - log_beta(alpha, beta)
    value = value + (alpha - alpha_new) * torch.digamma(alpha)
    value = value + (beta - beta_new) * torch.digamma(beta)
    return (value + (alpha_new + beta_new - total) * torch.digamma(total)).numpy()
