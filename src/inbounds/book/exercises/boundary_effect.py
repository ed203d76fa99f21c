"""Grader of the chapter *The boundary effect* (`judging` tells how one works)."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy import special, stats

from inbounds.book.exercises.judging import Case, Judgement, judge_cases


def capg_score(function: Callable[..., Any]) -> Judgement:
    """The score of a clipped Gaussian at the executed action, for (loc, log scale)."""

    def case(action: float, loc: float, scale: float, low: float, high: float, **known: Any) -> Case:
        t = (action - loc) / scale
        gaussian = np.array([t / scale, t * t - 1.0])
        expected, mistakes = gaussian, {}
        if action in (low, high):
            side = 1.0 if action == high else -1.0
            # φ/Φ(−w) by the scaled complementary error function: finite however improbable the bound
            hazard = math.sqrt(2 / math.pi) / special.erfcx(side * t / math.sqrt(2))
            expected = np.array([side * hazard / scale, side * t * hazard])
            mass, density = stats.norm.sf(side * t), stats.norm.pdf(t)
            mistakes = {
                "that is the Gaussian's score at the clipped action: a bound has a mass, not a density": gaussian,
                "that is the derivative of the bound's mass: the score is that of its *logarithm*": expected
                * mass,
                "that is the density at the bound: differentiate the log of the mass": np.full(2, density),
                "the wrong side: does the mass on this bound grow with μ, or shrink?": -expected,
            }
        mistakes |= {
            "the second entry is the derivative in σ; in log σ it is σ times that": expected / [1.0, scale],
            "the first entry lacks a factor 1/σ": expected * [scale, 1.0],
        }
        return Case((action, loc, scale, low, high), expected, mistakes, **known)

    underflow = (
        "a bound 50 standard deviations away has the mass 0 in floating point: divide logarithms (log_ndtr)"
    )
    cases = [
        case(0.3, -0.1, 0.7, -1.0, 1.0, hint="wrong between the bounds, where nothing is clipped"),
        case(1.0, 0.4, 0.7, -1.0, 1.0),
        case(-2.0, -1.3, 1.9, -2.0, 0.5),
        case(1.0, -4.0, 0.1, -1.0, 1.0, hint=underflow),
        case(-0.4, 4.6, 0.1, -0.4, 0.4, hint=underflow),
    ]
    return judge_cases(
        function, cases, "right, on both bounds, between them, and for a bound that is never reached"
    )
