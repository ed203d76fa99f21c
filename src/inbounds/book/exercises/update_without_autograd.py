"""Graders of the page *The same update, without autograd* (`judging` tells how one works)."""

from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from inbounds.book.exercises.judging import Case, Judgement, detached, judge_cases

__all__ = ["clipped_value_slope", "residual_backward"]


def clipped_value_slope(function: Callable[..., Any]) -> Judgement:
    """Judge the derivative of the clipped value loss, elementwise, by the value."""
    value = np.array([0.3, 1.9, 0.1, -1.0, 1.5, 2.5, -0.6])
    old = np.array([0.2, 0.4, 0.9, 0.1, 1.4, 0.5, 0.7])
    target = np.array([1.0, 3.0, -2.0, 0.9, 1.2, 0.3, 0.8])
    clip = 0.2
    plain = 2 * (value - target)
    moved = np.abs(value - old) <= clip
    inner = old + np.clip(value - old, -clip, clip) - target
    right = _by_autograd(value, old, target, clip)
    smaller = np.where((value - target) ** 2 < inner**2, plain, 2 * inner * moved)
    mistakes = {
        "that is the slope of (V − G)² alone: where the clipped term is the larger, it is the one that counts": plain,
        "a factor 2 is missing: the derivative of a square": right / 2,
        "that is the smaller of the two losses: the clipped value loss takes the larger": smaller,
        "outside the clip range the clipped term does not depend on V: its slope is zero there": np.where(
            (value - target) ** 2 >= inner**2, plain, 2 * inner
        ),
        "the sign: this is a loss, not an objective": -right,
    }
    case = Case((value, old, target, clip), right, mistakes)
    return judge_cases(
        function, [case], "right inside the clip range, beyond it, and where the terms change places"
    )


def _by_autograd(value: NDArray[Any], old: NDArray[Any], target: NDArray[Any], clip: float) -> NDArray[Any]:
    """The derivative as torch finds it."""
    v = torch.tensor(value, requires_grad=True)
    before, goal = torch.from_numpy(old), torch.from_numpy(target)
    held = before + torch.clamp(v - before, -clip, clip)
    loss = torch.maximum((v - goal) ** 2, (held - goal) ** 2)
    (slope,) = torch.autograd.grad(loss.sum(), v)
    found: NDArray[Any] = slope.numpy()
    return found


def residual_backward(function: Callable[..., Any]) -> Judgement:
    """Judge the backward pass of a layer x + tanh(W x + b): by the weights, the biases and the input."""

    def flat(*arguments: Any) -> Any:
        answer = detached(function(*arguments))
        if not isinstance(answer, tuple) or len(answer) != 3:
            return answer
        return np.concatenate([np.ravel(np.asarray(part, np.float64)) for part in answer])

    flat.__name__ = getattr(function, "__name__", "your function")
    rng = np.random.default_rng(4)
    weight, bias = rng.normal(size=(3, 3)), rng.normal(size=3)
    x, upstream = rng.normal(size=(3, 5)), rng.normal(size=(3, 5))
    leaves = [torch.tensor(a, requires_grad=True) for a in (weight, bias, x)]
    y = torch.tanh(leaves[0] @ leaves[2] + leaves[1][:, None])
    parts = torch.autograd.grad(((leaves[2] + y) * torch.from_numpy(upstream)).sum(), leaves)
    right = np.concatenate([part.numpy().ravel() for part in parts])
    inner = upstream * (1 - np.tanh(weight @ x + bias[:, None]) ** 2)
    by_weight, by_bias = (inner @ x.T).ravel(), inner.sum(1)

    def packed(*pieces: NDArray[Any]) -> NDArray[Any]:
        return np.concatenate([piece.ravel() for piece in pieces])

    mistakes = {
        "the input reaches the output by two ways, and the direct one is missing": packed(
            by_weight, by_bias, weight.T @ inner
        ),
        "the slope of tanh is missing: what goes into W is the upstream derivative times 1 − tanh²": packed(
            upstream @ x.T, upstream.sum(1), upstream + weight.T @ upstream
        ),
        "the bias takes the sum over the batch, not the mean": packed(
            by_weight, inner.mean(1), upstream + weight.T @ inner
        ),
        "back to the input it is the transposed matrix": packed(
            by_weight, by_bias, upstream + weight @ inner
        ),
    }
    return judge_cases(flat, [Case((weight, bias, x, upstream), right, mistakes)], "right, by all three")
