"""Value regression for the algorithms whose policy step is their own: REINFORCE and TRPO."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from torch import Tensor

from inbounds.learning.networks.actor_critic import ActorCritic
from inbounds.learning.networks.adam import SeedAdam
from inbounds.learning.rollout import Rollout
from inbounds.learning.updates.minibatches import minibatches

if TYPE_CHECKING:  # numba is an extra
    from inbounds.learning.updates.compiled import CompiledAdam


def fit_values(
    networks: ActorCritic,
    optimizer: SeedAdam | CompiledAdam,
    rollout: Rollout,
    return_: Tensor,
    generators: Sequence[np.random.Generator],
    num_epochs: int,
    minibatch_size: int,
) -> None:
    """Move the value networks towards the returns: Adam on the mean squared error over shuffled minibatches.

    Args:
        networks: whose critic to change.
        optimizer: over the critic alone, of either engine.
        rollout: `[S, T, ...]`.
        return_: `[S, T]` targets.
        generators: one per seed, for the order of its minibatches.
        num_epochs: passes over the rollout.
        minibatch_size: B, a divisor of T.
    """
    if not isinstance(optimizer, SeedAdam):
        (generator,) = generators
        optimizer.value_passes(rollout, return_, generator, num_epochs, minibatch_size)
        return
    for _ in range(num_epochs):
        for batch in minibatches(rollout, return_, return_, minibatch_size, generators):
            error = networks.values(batch.obs) - batch.return_
            optimizer.minimize(error.square().sum() / minibatch_size)
