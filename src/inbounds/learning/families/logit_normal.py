"""`logit-normal`: a Normal behind a sigmoid, 2 sigmoid(z) − 1 = tanh(z/2); its law is the Gaussian's."""

from __future__ import annotations

import functools
import math
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.autograd.function import once_differentiable

from inbounds.distributions import LogitNormal, trapezoid
from inbounds.learning.families.family import Family
from inbounds.learning.families.gaussian import (
    NORMAL,
    NormalParameters,
    normal_entropy,
    normal_head_bias,
    normal_scales,
)


def logit_normal(parameters: NormalParameters) -> LogitNormal:
    """Return the law of the unit action tanh(z/2), elementwise `[..., A]`."""
    return LogitNormal(parameters.loc, parameters.log_scale.exp(), -1.0, 1.0, validate_args=False)


def logit_normal_entropy(parameters: NormalParameters) -> Tensor:
    """Return the entropy `[...]` of the unit action tanh(z/2), in nats: the Normal's plus the map's expected log-slope.

    Within 1e-3 nats of `LogitNormal.entropy` for every log σ ≤ 1, which is as far as policies go by default (at
    log σ = 2 it is off by some 0.03), at a twentieth of its cost: a bonus, which is multiplied by 1e-4, need not be
    exact to the last bit. Differentiable once.

    Example:
        >>> import torch
        >>> from inbounds.learning.families import NormalParameters
        >>> from inbounds.learning.families.gaussian import normal_entropy
        >>> narrow = NormalParameters(torch.zeros(1), torch.full((1,), -4.0))  # at 0 the map halves lengths
        >>> round((normal_entropy(narrow) - logit_normal_entropy(narrow)).item(), 3)  # log 2
        0.693
    """
    log_slope: Tensor = _ExpectedLogSlope.apply(*parameters)
    return normal_entropy(parameters) + log_slope.sum(-1)


class _ExpectedLogSlope(torch.autograd.Function):
    """E[log ½(1 − tanh²(z/2))] for z ~ Normal, elementwise: by 15 nodes, its gradient by the same nodes.

    With log ½(1 − tanh²(z/2)) = log 2 − 2 (|z|/2 + log(1 + exp(−|z|))) and its derivative −tanh(z/2). In NumPy
    and with long inner loops, because PPO evaluates it in every minibatch.
    """

    @staticmethod
    def forward(ctx: Any, loc: Tensor, log_scale: Tensor) -> Tensor:
        nodes, weights = nodes_and_weights(loc.dtype)
        scale = np.exp(log_scale.numpy()).ravel()
        # [N, M], soon z/2; in place, because fresh memory costs more than arithmetic
        half = nodes[:, None] * scale
        half += loc.numpy().ravel()
        half *= 0.5
        slope = np.tanh(half)
        np.abs(half, out=half)
        bend = np.exp(-2 * half)
        bend += 1
        np.log(bend, out=bend)
        bend += half
        log_slope = math.log(2) - 2 * (weights @ bend)
        to_loc, to_log_scale = -weights @ slope, -(weights * nodes) @ slope * scale
        ctx.save_for_backward(*(torch.from_numpy(g).view(loc.shape) for g in (to_loc, to_log_scale)))
        return torch.from_numpy(log_slope).view(loc.shape)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor, Tensor]:
        to_loc, to_log_scale = ctx.saved_tensors
        return grads[0] * to_loc, grads[0] * to_log_scale


@functools.cache
def nodes_and_weights(dtype: torch.dtype) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the nodes and weights `[15]` of the bonus entropy's rule for the standard Normal."""
    nodes, weights = trapezoid(15, 5.0, dtype)
    return nodes.numpy(), weights.numpy()


def squashed_std(scale: float) -> float:
    """Return the standard deviation of tanh(z/2) for a centred Normal z, by quadrature.

    Beyond the default limit of σ by the public law, whose rule is finer where the squash is a step to the plain one.
    """
    if scale > 1e16:  # 1 − 0.8/scale rounds to 1; the rule has lost its digits, and later overflows
        return 1.0
    if scale > math.e:
        return float(LogitNormal(torch.zeros((), dtype=torch.float64), scale, -1.0, 1.0).stddev)
    nodes, weights = (x.numpy() for x in trapezoid())
    return math.sqrt(np.sum(weights * np.tanh(scale * nodes / 2) ** 2))


FAMILY = Family(
    name="logit-normal",
    law=NORMAL,
    to_unit=lambda latent, xp: xp.tanh(latent / 2),
    entropy=logit_normal_entropy,
    greedy={
        "mean": lambda p: logit_normal(p).mean,
        "median": lambda p: logit_normal(p).median,
        "mode": lambda p: logit_normal(p).mode,
    },
    distribution=lambda p, low, high: LogitNormal(p.loc, p.log_scale.exp(), low, high),
    executed_std=squashed_std,
    scales=normal_scales,
    head_bias=lambda std, limits: normal_head_bias(squashed_std, std, limits),
    kernels="inbounds.learning.families.logit_normal_kernel",
)
