"""One seed's perceptron in compiled loops: forward, backward, clipping and Adam. Needs numba, the extra `fast`.

Everything is laid out as in `inbounds.learning.networks.perceptron`: activations `[features, B]`, the weights of a
network in one row of numbers. One seed at a time: what an update touches then stays in the processor's cache.

Literals would be float64 to numba, and would make float64 of all that they meet: constants come from `dtype.type`.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from inbounds.learning.networks.normalizer import CLIP, EPSILON

FAST = {"reassoc", "contract", "nsz", "arcp"}
"""Sums may be reordered, products fused. Never `nnan` and `ninf`: they would let a diverged seed look sound."""

kernel: Any = numba.njit(fastmath=FAST, error_model="numpy")
"""Compiles a function when another compiled one calls it."""

_SATURATED = 9.01  # beyond it tanh is 1 in float32
_P = (1.0, 0.13379872, 3.4942073e-3, 2.0585978e-5, 1.3321933e-8)
_Q = (1.0, 0.46713188, 2.5871756e-2, 3.2833600e-4, 7.7633143e-7)


class Net(NamedTuple):
    """One seed's network, its gradient, its optimiser and room for a minibatch."""

    theta: NDArray[Any]
    """`[P]` weights and biases, layer after layer, and the padding of the row."""
    gradient: NDArray[Any]
    """`[P]`."""
    momentum: NDArray[Any]
    """`[P]` Adam's first moment."""
    square: NDArray[Any]
    """`[P]` Adam's second moment."""
    sizes: NDArray[Any]
    """`[L + 1]` units of each layer, inputs first."""
    units: NDArray[Any]
    """`[units, B]` of all layers but the inputs: after tanh; of the last layer, the outputs."""
    deltas: NDArray[Any]
    """`[units, B]` the loss' derivatives by what went into tanh; of the last layer, by the outputs."""


class AdamNumbers(NamedTuple):
    """Adam's constants, in the networks' precision."""

    learning_rate: Any
    eps: Any
    max_grad_norm: Any
    """Infinite where gradients are not clipped."""


@kernel
def rational_tanh(x: Any) -> None:
    """Replace x by tanh x in float32: x P(x²)/Q(x²), a least-squares fit; within 4e-7. NaN stays NaN."""
    number = x.dtype.type
    one, top = number(1), number(_SATURATED)
    p0, p1, p2, p3, p4 = number(_P[0]), number(_P[1]), number(_P[2]), number(_P[3]), number(_P[4])
    q0, q1, q2, q3, q4 = number(_Q[0]), number(_Q[1]), number(_Q[2]), number(_Q[3]), number(_Q[4])
    for i in range(len(x)):
        v = top if x[i] > top else x[i]  # a NaN is neither above nor below
        v = -top if v < -top else v
        y = v * v
        above = v * (p0 + y * (p1 + y * (p2 + y * (p3 + y * p4))))
        v = above / (q0 + y * (q1 + y * (q2 + y * (q3 + y * q4))))
        v = one if v > one else v
        x[i] = -one if v < -one else v


@kernel
def tanh(x: Any) -> None:
    """Replace x, `[N]`, by its hyperbolic tangent."""
    if x.itemsize == 4:
        rational_tanh(x)
    else:
        for i in range(len(x)):
            x[i] = math.tanh(x[i])


@kernel
def forward(net: Net, obs: Any) -> Any:
    """Return the outputs `[out, B]` for observations `[O, B]`, and leave every layer's units in the net."""
    below, at, row = obs, 0, 0
    depth = len(net.sizes) - 1
    for layer in range(depth):
        n_in, n_out = net.sizes[layer], net.sizes[layer + 1]
        weight = net.theta[at : at + n_out * n_in].reshape(n_out, n_in)
        bias = net.theta[at + n_out * n_in : at + n_out * n_in + n_out]
        above = net.units[row : row + n_out]
        np.dot(weight, below, above)
        for i in range(n_out):
            for b in range(above.shape[1]):
                above[i, b] += bias[i]
            if layer < depth - 1:
                tanh(above[i])
        below, at, row = above, at + n_out * (n_in + 1), row + n_out
    return below


@kernel
def backward(net: Net, obs: Any) -> None:
    """Fill the gradient, from the derivatives by the outputs in the last rows of `deltas`.

    With δ of a layer: ∂W = δ hᵀ, ∂b = Σ δ, and of the layer below Wᵀ δ ⊙ (1 − h²).
    """
    one = net.theta.dtype.type(1)
    at, row = 0, 0
    for layer in range(len(net.sizes) - 1):
        at += net.sizes[layer + 1] * (net.sizes[layer] + 1)
        row += net.sizes[layer + 1]
    for layer in range(len(net.sizes) - 2, -1, -1):
        n_in, n_out = net.sizes[layer], net.sizes[layer + 1]
        at, row = at - n_out * (n_in + 1), row - n_out
        delta = net.deltas[row : row + n_out]
        below = net.units[row - n_in : row] if layer else obs
        gradient = net.gradient[at : at + n_out * n_in].reshape(n_out, n_in)
        np.dot(delta, below.T, gradient)
        for i in range(n_out):
            total = delta[i, 0]
            for b in range(1, delta.shape[1]):
                total += delta[i, b]
            net.gradient[at + n_out * n_in + i] = total
        if layer:
            weight = net.theta[at : at + n_out * n_in].reshape(n_out, n_in)
            deeper = net.deltas[row - n_in : row]
            np.dot(weight.T, delta, deeper)
            for i in range(n_in):
                for b in range(delta.shape[1]):
                    deeper[i, b] *= one - below[i, b] * below[i, b]


@kernel
def sum_of_squares(x: Any) -> Any:
    """Return Σ x², of x `[N]`."""
    total = x.dtype.type(0)
    for i in range(len(x)):
        total += x[i] * x[i]
    return total


@kernel
def descend(nets: Any, numbers: AdamNumbers, step: int) -> None:
    """Clip the joint gradient of some nets, as `clip_gradients` does, and take Adam's step number `step`, from 1 on."""
    number = nets[0].theta.dtype.type
    scale = number(1)
    if numbers.max_grad_norm != np.inf:
        squares = number(0)
        for net in nets:
            squares += sum_of_squares(net.gradient)
        scale = numbers.max_grad_norm / (np.sqrt(squares) + number(1e-6))
        scale = number(1) if scale > number(1) else scale  # NaN stays NaN
    for net in nets:
        adam(net, numbers, scale, step)


@kernel
def adam(net: Net, numbers: AdamNumbers, scale: Any, step: int) -> None:
    """Move the weights by Adam's step number `step` down the gradient times `scale`."""
    number = net.theta.dtype.type
    keep_mean, keep_square = number(0.9), number(0.999)
    new_mean, new_square = number(1 - 0.9), number(1 - 0.999)
    rate = number(numbers.learning_rate / (1 - 0.9**step))
    root = number(math.sqrt(1 - 0.999**step))
    for i in range(len(net.theta)):
        g = scale * net.gradient[i]
        mean = keep_mean * net.momentum[i] + new_mean * g
        square = keep_square * net.square[i] + new_square * g * g
        net.momentum[i] = mean
        net.square[i] = square
        net.theta[i] -= rate * mean / (np.sqrt(square) / root + numbers.eps)


def see(obs: Any, count: int, mean: Any, squares: Any, seen: Any) -> None:
    """Take observations `[S, O]` into running statistics, and fill `seen` with them normalised.

    Rounded as `RunningNormalizer` rounds: no fast-math here, so that both engines show their networks the same.
    """
    for s in range(obs.shape[0]):
        for i in range(obs.shape[1]):
            deviation = obs[s, i] - mean[s, i]
            mean[s, i] += deviation / count
            squares[s, i] += deviation * (obs[s, i] - mean[s, i])
            scaled = (obs[s, i] - mean[s, i]) / math.sqrt(squares[s, i] / count + EPSILON)
            scaled = -CLIP if scaled < -CLIP else scaled
            seen[s, i] = CLIP if scaled > CLIP else scaled


@kernel
def affine(weight: Any, bias: Any, x: Any, out: Any) -> None:
    """Fill out `[n]` with W x + b, of x `[k]`."""
    for i in range(len(out)):
        total = weight.dtype.type(0)
        for k in range(len(x)):
            total += weight[i * len(x) + k] * x[k]
        out[i] = total + bias[i]


def outputs(thetas: Any, sizes: Any, obs: Any, units: Any, out: Any) -> None:
    """Fill out `[S, out]` with the networks' outputs for one observation each `[S, O]`; units `[2, most]` is room."""
    depth = len(sizes) - 1
    for s in range(len(thetas)):
        theta, below, at = thetas[s], obs[s], 0
        for layer in range(depth):
            n_in, n_out = sizes[layer], sizes[layer + 1]
            above = out[s] if layer == depth - 1 else units[layer % 2, :n_out]
            affine(theta[at : at + n_out * n_in], theta[at + n_out * n_in :], below, above)
            if layer < depth - 1:
                tanh(above)
            below, at = above, at + n_out * (n_in + 1)
