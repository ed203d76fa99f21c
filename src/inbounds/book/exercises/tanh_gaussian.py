"""Graders of the page *The tanh-Gaussian* (`judging` tells how one works)."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inbounds.book.exercises.judging import Case, Judgement, judge_cases

__all__ = ["ported"]


def ported(function: Callable[..., Any]) -> Judgement:
    """Judge the layer `[2, H + 1]` of a tanh-Gaussian head that has the law of a given logit-normal head."""
    rng = np.random.default_rng(0)

    def case(width: int) -> Case:
        layer = rng.normal(size=(2, width + 1))
        mistakes = {
            "that is the layer as it was: the tanh-Gaussian would have twice the location and scale": layer,
            "μ is right, σ is not: log s = log σ − log 2": changed(layer, 0.5, 0.0),
            "σ is right, μ is not: m = μ/2": changed(layer, 1.0, -np.log(2)),
            "the wrong way round: from a tanh-Gaussian head to a logit-normal one": changed(
                layer, 2.0, np.log(2)
            ),
            "halving the row of log σ takes a root of σ: subtract log 2 from its bias": layer / 2,
            "log 2 belongs to the bias alone, not to every weight of the row": changed(
                layer, 0.5, -np.log(2), everywhere=True
            ),
        }
        return Case((layer,), changed(layer, 0.5, -np.log(2)), mistakes)

    return judge_cases(function, [case(3), case(64)], "right: the same law in every state")


def changed(layer: NDArray[Any], factor: float, shift: float, *, everywhere: bool = False) -> NDArray[Any]:
    """Return the layer with its first row multiplied and the bias of the second shifted, or all of that row."""
    new = layer.copy()
    new[0] *= factor
    new[1, slice(None) if everywhere else -1] += shift
    return new
