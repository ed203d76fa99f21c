"""Grader of the chapter *Beta policies* (`judging` tells how one works)."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from scipy import stats

from inbounds.book.exercises.judging import Case, Judgement, judge_cases


def beta_log_prob(function: Callable[..., Any]) -> Judgement:
    """The log-density of a Beta on an interval.

    Args:
        function: the reader's ``beta_log_prob(action, alpha, beta, low, high)``, of numbers.

    Example:
        >>> beta_log_prob(lambda action, alpha, beta, low, high: ...)
        … not answered: <lambda>: write it, and run this cell again
    """

    def case(action: float, alpha: float, beta: float, low: float, high: float, **known: Any) -> Case:
        length = high - low
        exact = float(stats.beta(alpha, beta, loc=low, scale=length).logpdf(action))
        x = (action - low) / length
        kernel = (alpha - 1) * math.log(x) + (beta - 1) * math.log(1 - x)
        mistakes = {
            "the length of the interval is missing: a = ℓ + Lx divides the density by L": exact
            + math.log(length),
            "divide by the length, do not multiply": exact + 2 * math.log(length),
            "α and β have changed places: α pulls towards high": float(
                stats.beta(beta, alpha, loc=low, scale=length).logpdf(action)
            ),
            "the normaliser is missing: subtract log B(α, β)": kernel - math.log(length),
            "the sign of log B: the density is divided by B": 2 * kernel - exact - 2 * math.log(length),
            "the exponents are α − 1 and β − 1": exact + math.log(x) + math.log(1 - x),
            "that is the density: return its logarithm": math.exp(exact) if exact < 700 else math.inf,
            "the action is in units of the box: (a − ℓ)/L is the fraction": (
                float(stats.beta(alpha, beta).logpdf(action)) - math.log(length)
                if 0 < action < 1
                else math.nan
            ),
        }
        return Case((action, alpha, beta, low, high), exact, mistakes, **known)

    overflow = (
        "Γ(500) overflows, and single precision loses its digits: "
        "add and subtract logarithms, in double precision (scipy.special.betaln)"
    )
    cases = [
        case(0.3, 2.5, 1.5, -1.0, 1.0),
        case(0.1, 3.0, 5.0, 0.0, 0.4),
        case(2.2, 1.0, 4.0, -0.5, 4.5),
        case(0.1, 500.0, 400.0, -1.0, 1.0, hint=overflow),
    ]
    return judge_cases(function, cases, "right, on every box, and for large parameters")
