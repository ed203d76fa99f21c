r"""The logit-normal in compiled loops: the Normal's score, and the bonus entropy's slope. Needs numba.

The entropy of the unit action is the Normal's plus E[log ½(1 − tanh²(z/2))]. With z = μ + σx and the same 15 nodes x_i
and weights w_i as in `logit_normal_entropy`, its derivatives are

$$ ∂/∂μ = −Σ w_i tanh(z_i/2),   ∂/∂ log σ = −Σ w_i x_i σ tanh(z_i/2). $$
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import torch

from inbounds.learning.families import gaussian_kernel
from inbounds.learning.families.gaussian_kernel import beyond, clipped, score
from inbounds.learning.families.logit_normal import nodes_and_weights
from inbounds.learning.networks.kernels import kernel, tanh

__all__ = ["entropy_slope", "score"]

_NODES, _WEIGHTS = nodes_and_weights(torch.float64)
_of_the_normal = gaussian_kernel.entropy_slope


@kernel
def entropy_slope(outputs: Any, limits: Any, slope: Any) -> None:
    """Fill slope `[2A, B]` with the derivatives of the bonus entropy by the outputs `[2A, B]`."""
    _of_the_normal(outputs, limits, slope)
    act_dim, size = outputs.shape[0] // 2, outputs.shape[1]
    number = outputs.dtype.type
    half = number(0.5)
    scale, bend = np.empty(size, outputs.dtype), np.empty(size, outputs.dtype)
    for a in range(act_dim):
        loc, to_loc, to_log_scale = outputs[a], slope[a], slope[act_dim + a]
        for b in range(size):
            scale[b] = math.exp(clipped(outputs[act_dim + a, b], limits))
        for n in range(len(_NODES)):
            node, weight = number(_NODES[n]), number(_WEIGHTS[n])
            for b in range(size):
                bend[b] = half * (loc[b] + scale[b] * node)
            tanh(bend)
            for b in range(size):
                to_loc[b] -= weight * bend[b]
                to_log_scale[b] -= weight * node * scale[b] * bend[b]
        for b in range(size):
            if beyond(outputs[act_dim + a, b], limits):
                to_log_scale[b] = number(0)
