"""A policy after training as a PyTorch module, for `torch.export` and ONNX: exported, it needs no `inbounds`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from inbounds.learning.families.policy import Policy
from inbounds.learning.networks.normalizer import CLIP
from inbounds.learning.networks.perceptron import SeedLinear


class DeployedPolicy(nn.Module):
    """Observations `[B, O]` to the actions `[B, A]` that `TrainedPolicy.act` returns; `TrainedPolicy.module` makes it.

    Args:
        policy: the family and its box.
        layers: of one seed's network.
        statistics: mean and standard deviation `[O]` of the observations; None where they are not normalised.
        greedy: of the family's greedy actions.

    Raises:
        ValueError: the median of a Beta, which SciPy computes.
    """

    def __init__(
        self,
        policy: Policy,
        layers: Sequence[SeedLinear],
        statistics: tuple[NDArray[Any], NDArray[Any]] | None,
        greedy: str,
    ) -> None:
        super().__init__()
        self._policy, self._unit = policy, policy.family.greedy[greedy]
        if greedy == "median":
            if "loc" not in policy.family.law.named.names():
                raise ValueError(
                    "a Beta's median comes from SciPy, which no graph of PyTorch holds: take the mean, module('mean')"
                )
            # Every map of a latent is monotone, and takes its median along.
            self._unit = lambda parameters: policy.family.to_unit(parameters.loc, torch)
        parts: list[nn.Module] = []
        for layer in layers:
            weight, bias = layer.weight[0].detach().clone(), layer.bias[0, :, 0].detach().clone()
            size_out, size_in = weight.shape
            linear = nn.Linear(size_in, size_out, dtype=weight.dtype)
            linear.load_state_dict({"weight": weight, "bias": bias})
            parts += [nn.Tanh(), linear]
        self.network = nn.Sequential(*parts[1:]).requires_grad_(False)
        box = {
            "low": policy.low,
            "high": policy.high,
            "centre": policy.centre,
            "half_range": policy.half_range,
        }
        mean, std = (None, None) if statistics is None else statistics
        for name, array in (box | {"mean": mean, "std": std}).items():
            self.register_buffer(name, None if array is None else torch.from_numpy(array).double())
        self._dtypes = layers[0].weight.dtype, getattr(torch, policy.dtype.name)  # of the network, of actions
        self.low: Tensor
        self.high: Tensor
        self.centre: Tensor
        self.half_range: Tensor
        self.mean: Tensor | None
        self.std: Tensor | None

    def forward(self, obs: Tensor) -> Tensor:
        """Return actions `[B, A]` for observations `[B, O]`, both as the environment has them."""
        seen = obs.double()
        if self.mean is not None and self.std is not None:
            seen = ((seen - self.mean) / self.std).clamp(-CLIP, CLIP)
        inner, outer = self._dtypes
        outputs = self.network(seen.to(inner))
        unit = self._unit(self._policy.parameters(outputs))
        action = (self.centre + self.half_range * unit).clamp(self.low, self.high)
        return action.to(outer)
