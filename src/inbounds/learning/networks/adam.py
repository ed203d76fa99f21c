"""Adam for S seeds at once, and gradient clipping that keeps them apart."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import Any

import torch
from torch import Tensor

from inbounds.learning.networks.perceptron import Mlp


class SeedAdam:
    """Adam (Kingma & Ba 2015) on the rows of one or more `theta [S, P]`.

    Adam is elementwise: one instance on the matrix is S instances on its rows. What would couple the seeds is
    the clipping by global norm, which is therefore done per row, jointly over the networks.

    Args:
        networks: whose `theta` to change.
        learning_rate: step size.
        eps: added to the root of the second moment.
        max_grad_norm: of a seed's gradient over all networks; None never clips.

    Example:
        >>> import torch
        >>> from inbounds.learning import Mlp
        >>> network = Mlp(2, (3, 1), torch.float32)
        >>> before = network.theta.clone()
        >>> adam = SeedAdam([network], learning_rate=0.1, eps=1e-8, max_grad_norm=None)
        >>> adam.minimize(sum(p.sum() for p in network.parameters))
        >>> round((network.theta - before).min().item(), 3)
        -0.1
    """

    def __init__(
        self, networks: Sequence[Mlp], learning_rate: float, eps: float, max_grad_norm: float | None
    ) -> None:
        self.networks = tuple(networks)
        self.parameters = [p for network in self.networks for p in network.parameters]
        self.max_grad_norm = max_grad_norm
        self._adam = torch.optim.Adam([n.padded for n in self.networks], learning_rate, eps=eps, fused=True)

    def minimize(self, loss: Tensor) -> None:
        """Take one step down the gradient of a loss that sums over seeds."""
        gradients = torch.autograd.grad(loss, self.parameters)
        start = 0
        for network in self.networks:
            stop = start + len(network.parameters)
            network.store_gradients(gradients[start:stop])
            start = stop
        if self.max_grad_norm is not None:
            clip_gradients(
                [n.padded.grad for n in self.networks if n.padded.grad is not None], self.max_grad_norm
            )
        self._adam.step()

    def state_dict(self) -> dict[str, Any]:
        """Return a copy of the moments and the step count."""
        return copy.deepcopy(self._adam.state_dict())

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Go back to a state."""
        self._adam.load_state_dict(copy.deepcopy(state))


@torch.no_grad()
def clip_gradients(gradients: Sequence[Tensor], max_norm: float) -> None:
    """Scale down, in place, the gradient of each seed whose norm over all tensors exceeds max_norm.

    Args:
        gradients: `[S, ...]` each.
        max_norm: the largest norm that is left alone.

    Example:
        >>> gradients = torch.tensor([[3.0, 4.0], [0.3, 0.4]])
        >>> clip_gradients([gradients], max_norm=1.0)
        >>> gradients.numpy().round(3)
        array([[0.6, 0.8],
               [0.3, 0.4]], dtype=float32)
    """
    squares = [torch.linalg.vector_norm(g, dim=1, keepdim=True).square() for g in gradients]
    norm = torch.stack(squares).sum(0).sqrt()  # [S, 1]
    scale = (max_norm / (norm + 1e-6)).clamp(max=1.0)
    for gradient in gradients:
        gradient.mul_(scale)
