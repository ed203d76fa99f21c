"""Shuffling a rollout into minibatches, each seed in its own order."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from inbounds.learning.advantages import normalize_advantage
from inbounds.learning.rollout import Rollout


class Minibatch(NamedTuple):
    """B steps of each of S seeds.

    Example:
        >>> import numpy as np
        >>> from inbounds.learning import Trainer, preset
        >>> from inbounds.learning.updates.minibatches import minibatches
        >>> rollout = Trainer(preset("common", "Hopper-v5", seeds=2)).collector.collect(64)
        >>> shuffles = [np.random.default_rng(seed) for seed in (0, 1)]
        >>> advantage, return_ = rollout.advantages(gamma=0.99, gae_lambda=0.95)
        >>> [tuple(batch.obs.shape) for batch in minibatches(rollout, advantage, return_, 32, shuffles)]
        [(2, 32, 11), (2, 32, 11)]
    """

    obs: Tensor
    """`[S, B, O]`."""
    latent: Tensor
    """`[S, B, A]`."""
    log_prob: Tensor
    """`[S, B]` under the policy that drew it, in nats."""
    advantage: Tensor
    """`[S, B]`."""
    return_: Tensor
    """`[S, B]` target of the value network."""


def minibatches(
    rollout: Rollout,
    advantage: Tensor,
    return_: Tensor,
    minibatch_size: int,
    generators: Sequence[np.random.Generator],
    normalize: bool = False,
) -> Iterator[Minibatch]:
    """Yield T/B minibatches that hold every step of the rollout once.

    Args:
        rollout: `[S, T, ...]`.
        advantage: `[S, T]`.
        return_: `[S, T]`.
        minibatch_size: B, a divisor of T.
        generators: one per seed, which draws that seed's permutation.
        normalize: subtract the mean of the advantages and divide by their standard deviation, per seed and minibatch.

    Yields:
        Minibatches `[S, B, ...]`. Latents are laid out feature-major, as the networks' outputs are: arithmetic between
        the two runs along memory.
    """
    num_seeds, horizon = rollout.num_seeds, rollout.horizon
    order = np.stack([generator.permutation(horizon) for generator in generators])  # [S, T]
    order += horizon * np.arange(num_seeds)[:, None]
    index = torch.from_numpy(order.reshape(num_seeds, -1, minibatch_size).swapaxes(0, 1).copy())  # [N, S, B]

    def gather(x: Tensor) -> Tensor:  # [S, T, ...] → [N, S, B, ...]
        return x.flatten(0, 1).index_select(0, index.flatten()).unflatten(0, index.shape)

    advantages = gather(advantage)
    if normalize:
        advantages = normalize_advantage(advantages)
    latents = gather(rollout.latent).mT.contiguous().mT
    columns = gather(rollout.obs), latents, gather(rollout.log_prob), advantages, gather(return_)
    yield from map(Minibatch, *columns)
