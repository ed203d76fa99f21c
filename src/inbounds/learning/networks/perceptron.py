r"""Ten networks as one: multi-layer perceptrons with a seed axis.

A `SeedLinear` holds S affine maps and applies them side by side, one batched matrix product for all seeds:

$$ h_{s} = W_s x_s + b_s,   W: [S, out, in],  x: [S, in, B]. $$

Activations are *feature-major*, the batch last: a head of a few outputs is then a short matrix, not a thin one,
which matrix libraries dislike. An `Mlp` keeps all its weights in one matrix `theta [S, P]`, a row per seed, of which
the layers are views: an optimiser steps on one tensor, and a seed's gradient is a row.
"""

from __future__ import annotations

import copy
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

_ROW_MULTIPLE = 16  # numbers; 64 bytes of float32


class _Tanh(torch.autograd.Function):
    """tanh by NumPy, on one core several times as fast as torch's; differentiable to any order."""

    @staticmethod
    def forward(ctx: Any, x: Tensor) -> Tensor:
        y = torch.from_numpy(np.tanh(x.detach().numpy()))
        ctx.save_for_backward(y)
        return y

    @staticmethod
    def backward(ctx: Any, *grads: Tensor) -> Tensor:
        (y,) = ctx.saved_tensors
        return torch.ops.aten.tanh_backward(grads[0], y)


def tanh(x: Tensor) -> Tensor:
    """Return the hyperbolic tangent of x, `[...]`.

    Example:
        >>> x = torch.tensor([0.5], requires_grad=True)
        >>> (slope,) = torch.autograd.grad(tanh(x), x)
        >>> round(slope.item(), 4)  # 1 − tanh²(½)
        0.7864
    """
    y: Tensor = _Tanh.apply(x)
    return y


@dataclass
class SeedLinear:
    """S affine maps side by side.

    Args:
        weight: `[S, out, in]`.
        bias: `[S, out, 1]`.

    Example:
        >>> import torch
        >>> layer = SeedLinear(weight=torch.ones(2, 1, 3), bias=torch.tensor([[[0.0]], [[10.0]]]))
        >>> layer(torch.ones(2, 3, 5))[:, 0, 0].tolist()  # two seeds, a batch of five
        [3.0, 13.0]
    """

    weight: Tensor
    bias: Tensor

    def __call__(self, x: Tensor) -> Tensor:
        """Return W x + b, `[S, out, B]`, for x `[S, in, B]`."""
        return torch.baddbmm(self.bias, self.weight, x)


def mlp(layers: Sequence[SeedLinear], obs: Tensor) -> Tensor:
    """Return the outputs of S perceptrons: tanh between the layers, none after the last.

    Args:
        layers: from the inputs to the outputs.
        obs: `[S, B, O]`.

    Returns:
        `[S, B, out]`.

    Example:
        >>> import torch
        >>> from inbounds.learning import SeedLinear
        >>> layer = SeedLinear(torch.ones(2, 1, 3), torch.zeros(2, 1, 1))
        >>> mlp([layer], torch.ones(2, 5, 3)).shape
        torch.Size([2, 5, 1])
    """
    h = obs.mT  # [S, O, B]
    for layer in layers[:-1]:
        h = tanh(layer(h))
    return layers[-1](h).mT


class Mlp:
    """The weights of S perceptrons of one shape.

    Args:
        num_seeds: perceptrons, S.
        sizes: of the layers, inputs first: (O, 64, 64, outputs).
        dtype: of the weights, torch.float32 or torch.float64.

    Example:
        >>> import torch
        >>> net = Mlp(num_seeds=10, sizes=(17, 64, 64, 12))
        >>> net.theta.shape, net(torch.zeros(10, 5, 17)).shape
        (torch.Size([10, 6092]), torch.Size([10, 5, 12]))
    """

    def __init__(self, num_seeds: int, sizes: Sequence[int], dtype: torch.dtype = torch.float32) -> None:
        self.sizes = tuple(sizes)
        shapes = [
            shape for n_in, n_out in itertools.pairwise(self.sizes) for shape in ((n_out, n_in), (n_out, 1))
        ]
        self._lengths = [rows * columns for rows, columns in shapes]
        count = sum(self._lengths)
        # Rows of whole cache lines: every seed's weights lie in memory as every other's do, so that the matrix library
        # and the vector instructions treat them alike, and a seed's result is the same in any row.
        self.padded = torch.zeros(num_seeds, -(-count // _ROW_MULTIPLE) * _ROW_MULTIPLE, dtype=dtype)
        self.padded.grad = torch.zeros_like(self.padded)
        self.theta = self.padded[:, :count]
        self.parameters = [
            part.unflatten(1, shape).detach().requires_grad_()
            for part, shape in zip(self.theta.split(self._lengths, 1), shapes, strict=True)
        ]
        self._gradients = [
            part.unflatten(1, shape)
            for part, shape in zip(self.padded.grad[:, :count].split(self._lengths, 1), shapes, strict=True)
        ]
        self._find_layers()

    def _find_layers(self) -> None:
        weights, biases = self.parameters[::2], self.parameters[1::2]
        self.layers = [SeedLinear(*pair) for pair in zip(weights, biases, strict=True)]
        self._arrays = [(layer.weight.detach().numpy(), layer.bias.detach().numpy()) for layer in self.layers]

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        """Return perceptrons with weights and gradients of their own, which a copied optimiser finds."""
        one = memo[id(self)] = object.__new__(type(self))
        one.__dict__.update(
            {
                name: copy.deepcopy(value, memo)
                for name, value in vars(self).items()
                if name not in ("layers", "_arrays")
            }
        )
        one._find_layers()
        return one

    def __reduce__(self) -> tuple[Any, ...]:
        """Let a pickle have the weights, and no gradients."""
        return _with_weights, (type(self), self.sizes, self.theta.clone())

    def seed(self, index: int) -> Self:
        """Return the perceptron of one seed, S = 1, which has its weights in common with these.

        Raises:
            IndexError: there are fewer seeds; negative indices count from the end.
        """
        row, one = row_of_seed(index, len(self.theta)), object.__new__(type(self))
        one.__dict__.update(self.__dict__)
        one.padded, one.theta = self.padded[row], self.theta[row]
        one.padded.grad = None if self.padded.grad is None else self.padded.grad[row]
        one.parameters = [part.detach()[row].requires_grad_() for part in self.parameters]
        one._gradients = [part[row] for part in self._gradients]
        one._find_layers()
        return one

    def __call__(self, obs: Tensor) -> Tensor:
        """Return the outputs `[S, B, out]` for observations `[S, B, O]`."""
        return mlp(self.layers, obs)

    def act(self, obs: NDArray[Any]) -> NDArray[Any]:
        """Return the outputs `[S, out]` for one observation per seed `[S, O]`, in plain NumPy and without a graph."""
        h = obs[:, :, None]  # [S, O, 1]
        for weight, bias in self._arrays[:-1]:
            h = weight @ h
            h += bias
            np.tanh(h, out=h)
        weight, bias = self._arrays[-1]
        return (weight @ h + bias)[:, :, 0]

    def store_gradients(self, gradients: Sequence[Tensor]) -> None:
        """Write gradients, one per parameter in order, into `padded.grad`, where the optimiser reads them."""
        for target, gradient in zip(self._gradients, gradients, strict=True):
            target.copy_(gradient)

    def named_tensors(self, prefix: str) -> dict[str, Tensor]:
        """Return copies `[S, out, in]` and `[S, out]` under names like `policy.0.weight`, for export."""
        return {
            f"{prefix}.{i}.{name}": tensor.detach().clone().contiguous()
            for i, layer in enumerate(self.layers)
            for name, tensor in (("weight", layer.weight), ("bias", layer.bias[:, :, 0]))
        }


def row_of_seed(index: int, num_seeds: int) -> slice:
    """Return the slice of one row of S, that of a seed; negative indices count from the end.

    Raises:
        IndexError: there are fewer seeds.

    Example:
        >>> row_of_seed(-1, 3)
        slice(2, 3, None)
    """
    if not -num_seeds <= index < num_seeds:
        raise IndexError(
            f"there is no seed {index}: choose one of the {num_seeds}, from 0 to {num_seeds - 1}"
        )
    start = index % num_seeds
    return slice(start, start + 1)


def flatten(tensors: Sequence[Tensor]) -> Tensor:
    """Return one row `[S, P]` per seed of what is shaped like the parameters of an `Mlp`."""
    return torch.cat([tensor.flatten(1) for tensor in tensors], 1)


@torch.no_grad()
def initialize_pytorch(net: Mlp, generators: Sequence[torch.Generator]) -> None:
    """Draw weights and biases uniformly on ±1/√in, as `torch.nn.Linear` does, each seed from its own generator."""
    for s, generator in enumerate(generators):
        for layer in net.layers:
            bound = 1 / math.sqrt(layer.weight.shape[2])
            for tensor in (layer.weight, layer.bias):
                tensor[s].uniform_(-bound, bound, generator=generator)


@torch.no_grad()
def initialize_orthogonal(net: Mlp, generators: Sequence[torch.Generator], head_gain: float) -> None:
    """Make each seed's weights orthogonal (Saxe et al. 2014), with the gain √2 below the last layer; its biases zero.

    Seed by seed: `torch.nn.init.orthogonal_` takes a three-dimensional tensor for one flattened matrix.

    Args:
        net: the networks, changed in place.
        generators: one per seed.
        head_gain: of the last layer; small, it makes the first policy the same in every state.
    """
    for s, generator in enumerate(generators):
        for i, layer in enumerate(net.layers):
            gain = head_gain if i == len(net.layers) - 1 else math.sqrt(2)
            torch.nn.init.orthogonal_(layer.weight[s], gain, generator=generator)
            layer.bias[s].zero_()


def _with_weights(kind: type[Mlp], sizes: tuple[int, ...], theta: Tensor) -> Mlp:
    net = kind(len(theta), sizes, theta.dtype)
    net.theta.copy_(theta)
    return net
