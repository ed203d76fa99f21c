"""Graders of the page *Trust region of what?* (`judging` tells how one works)."""

from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from scipy import optimize
from torch.distributions import kl_divergence

from inbounds.book.exercises.judging import Case, Judgement, judge_cases
from inbounds.distributions import ClippedNormal

__all__ = ["largest_step"]


def largest_step(function: Callable[..., Any]) -> Judgement:
    """Judge the largest step of a clipped Gaussian's location inwards, on [−1, 1]."""

    def case(mu: float, scale: float, max_kl: float) -> Case:
        right = _root(mu, scale, max_kl)
        mistakes = {
            "that is the Gaussian's step: measure the divergence of the clipped laws": scale
            * np.sqrt(2 * max_kl),
            "that is where μ arrives: return how far it went": mu - right,
            "that is a step outwards: go back towards the centre": _root(mu, scale, max_kl, outwards=True),
            "that is new to old: the first argument draws, the second is compared": _root(
                mu, scale, max_kl, swapped=True
            ),
            "the sign: return the length of the step": -right,
        }
        return Case((mu, scale, max_kl), right, mistakes, rtol=1e-4)

    cases = [case(0.5, 0.5, 0.01), case(1.2, 0.3, 0.02), case(3.0, 0.5, 0.01)]
    return judge_cases(function, cases, "right, inside the box and far outside")


def _root(mu: float, scale: float, max_kl: float, *, outwards: bool = False, swapped: bool = False) -> float:
    """Where the package's divergence reaches max_kl: not the reader's formula. Not a number if it never does."""
    sides = torch.tensor([mu, scale], dtype=torch.float64)

    def excess(step: float) -> float:
        old = ClippedNormal(sides[0], sides[1])
        new = ClippedNormal(sides[0] + (step if outwards else -step), sides[1])
        pair = (new, old) if swapped else (old, new)
        return float(kl_divergence(*pair)) - max_kl

    farthest = mu + 8 * scale
    return float(optimize.brentq(excess, 1e-9, farthest, xtol=1e-12)) if excess(farthest) > 0 else np.nan
