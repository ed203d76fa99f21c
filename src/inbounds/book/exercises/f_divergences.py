"""Graders of the page *Every divergence, and every map* (`judging` tells how one works)."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from inbounds.book.exercises.judging import Case, Judgement, judge_cases

__all__ = ["binned_kl"]


def binned_kl(function: Callable[..., Any]) -> Judgement:
    """Judge the KL divergence of two Gaussians seen through bins."""

    def case(
        loc: float, scale: float, loc_new: float, scale_new: float, edges: list[float], **known: Any
    ) -> Case:
        old, new = _log_probabilities(loc, scale, edges), _log_probabilities(loc_new, scale_new, edges)
        inner = [x[1:-1] - np.logaddexp.reduce(x[1:-1]) for x in (old, new)]
        full = np.log(scale_new / scale) + (scale**2 + (loc - loc_new) ** 2) / (2 * scale_new**2) - 0.5
        mistakes = {
            "that is the Gaussians' divergence: sum over the bins instead": full,
            "that is new to old: the first argument draws, the second is compared": _kl(new, old),
            "the first and the last bin are missing": _kl(old[1:-1], new[1:-1]),
            "the bins at both ends are missing, and the others made to sum to one": _kl(inner[0], inner[1]),
            "the sign is wrong: a divergence is not negative": -_kl(old, new),
            "divide by log 2 for bits; the book's divergences are in nats": _kl(old, new) / np.log(2),
        }
        return Case((loc, scale, loc_new, scale_new, np.array(edges)), _kl(old, new), mistakes, **known)

    cases = [
        case(0.0, 1.0, 0.8, 0.7, [-1.0, 0.0, 1.0]),
        case(-0.3, 2.5, 0.3, 2.0, [-1.0, -0.5, 0.2, 1.0]),
        case(
            9.5,
            1.0,
            0.0,
            1.0,
            [-1.0, 0.0, 9.0],
            hint="under the new law the last bin has probability 10⁻¹⁹: 1 − Φ(9) is 0 in floating point, Φ(−9) is not",
        ),
        case(
            0.0,
            1.0,
            45.0,
            1.0,
            [-1.0, 0.0, 1.0],
            hint="under the new law three bins have probabilities that are 0 in floating point: take logarithms",
        ),
    ]
    return judge_cases(function, cases, "right, and in the far tail too")


def _log_probabilities(loc: float, scale: float, edges: list[float]) -> NDArray[Any]:
    """The logarithms of the bins' probabilities; above the middle from upper tails, which keep their digits."""
    law, ends = stats.norm(loc, scale), np.array([-np.inf, *edges, np.inf])
    upper = ends[:-1] > loc
    more = np.where(upper, law.logsf(ends[:-1]), law.logcdf(ends[1:]))
    less = np.where(upper, law.logsf(ends[1:]), law.logcdf(ends[:-1]))
    return more + np.log1p(-np.exp(less - more))


def _kl(p: Any, q: Any) -> float:
    """The divergence of two laws, of which the logarithms of the probabilities are given."""
    p, q = np.asarray(p), np.asarray(q)
    return float(np.sum(np.exp(p) * (p - q)))
