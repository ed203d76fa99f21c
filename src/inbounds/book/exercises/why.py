"""Graders of the chapter *Why* (`judging` tells how one works)."""

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy import integrate, optimize, stats

from inbounds.book.exercises.judging import Case, Judgement, judge_cases


def _clipped_std(scale: float) -> float:
    """Standard deviation of a centred Gaussian clipped to [−1, 1], by quadrature."""
    inside, _ = integrate.quad(lambda a: a**2 * stats.norm.pdf(a, scale=scale), -1, 1, epsabs=1e-13)
    return float(np.sqrt(inside + 2 * stats.norm.sf(1, scale=scale)))


def _truncated_std(scale: float) -> float:
    return float(stats.truncnorm.std(-1 / scale, 1 / scale, scale=scale))


def _scale_for(std_of: Callable[[float], float], std: float) -> float:
    return float(optimize.brentq(lambda s: std_of(s) - std, 1e-3, 200, xtol=1e-12))


def matched_scale(function: Callable[..., Any]) -> Judgement:
    """σ of the centred Gaussian whose action, clipped to [−1, 1], has a given standard deviation."""

    def case(std: float, hint: str) -> Case:
        mistakes = {"that is the deviation before clipping: clipping takes some of it away": std}
        if std < 0.5:  # a truncated Gaussian cannot be wider than the uniform law
            mistakes["that is a Gaussian cut off at the bounds: clipping leaves the mass there"] = _scale_for(
                _truncated_std, std
            )
        return Case((std,), _scale_for(_clipped_std, std), mistakes, hint, rtol=1e-4)

    cases = [
        case(0.4, "Var = ∫ a² φ over the box, plus the mass beyond it, which counts as 1"),
        case(0.2, "where hardly anything is clipped, σ is nearly the deviation asked for"),
        case(0.7184, "σ = 1 gives 0.7184: the default of a Gaussian policy"),
        case(0.9, "wide noise needs a wide bracket for the root"),
    ]
    return judge_cases(function, cases, "right, from hardly clipped to nearly all of it")
