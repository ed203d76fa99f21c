"""Grader of the page *Other libraries* (`judging` tells how one works)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import special

from inbounds.book.exercises.judging import Case, Judgement, judge_cases

__all__ = ["actions_of"]


def actions_of(function: Callable[..., Any]) -> Judgement:
    """Actions of a logit-normal's latents, and their distance from the nearer bound.

    Args:
        function: the reader's ``actions_of(latent, low, high)``, of arrays `[N, A]`, `[A]` and `[A]`.

    Example:
        >>> actions_of(lambda z, low, high: (low + (high - low) / (1 + np.exp(-z)), None))
        ✗ not yet: <lambda>: the distance is missing: return the pair (action, distance)
    """

    def of(latent: NDArray[Any], low: NDArray[Any], high: NDArray[Any]) -> Any:
        answer = function(latent.copy(), low.copy(), high.copy())
        if isinstance(answer, tuple) and len(answer) == 2 and answer[1] is None:
            return answer[0]
        return answer

    of.__name__ = getattr(function, "__name__", "actions_of")
    latent = np.array([[-30.0, 30.0], [-2.0, 0.5], [0.25, -28.0], [3.0, 22.0]])
    low, high = np.array([-2.0, 0.0]), np.array([8.0, 1.0])
    width, fraction = high - low, special.expit(latent)
    near = width * special.expit(-np.abs(latent))
    action = low + width * fraction
    read = np.minimum(action - low, high - action)
    tanh = low + width * special.expit(2 * latent)
    mistakes: dict[str, Any] = {
        "the distance is missing: return the pair (action, distance)": action,
        "the distance is read off the action: far out the subtraction has lost it": (action, read),
        "that is the distance from the lower bound everywhere: take the nearer one": (
            action,
            width * fraction,
        ),
        "that is the distance from the upper bound everywhere: take the nearer one": (
            action,
            width * special.expit(-latent),
        ),
        "tanh(z) has twice the slope: the logit-normal's map is the sigmoid, tanh(z/2)": (
            tanh,
            width * special.expit(-2 * np.abs(latent)),
        ),
        "the distance has no units: multiply by the length of the interval": (action, near / width),
        "that is the unit box, [−1, 1]: this one has its own bounds": (
            2 * fraction - 1,
            2 * special.expit(-np.abs(latent)),
        ),
        "distance first, action second: they have changed places": (near, action),
    }
    case = Case((latent, low, high), (action, near), mistakes, hint="some action or distance is wrong")
    return judge_cases(of, [case], "right, near both bounds")
