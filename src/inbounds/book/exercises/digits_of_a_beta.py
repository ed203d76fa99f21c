"""Grader of *What single precision does to a Beta* (`judging` tells how one works)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from scipy import special

from inbounds.book.exercises.judging import Case, Judgement, judge_cases

__all__ = ["safe_beta_kl"]


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
