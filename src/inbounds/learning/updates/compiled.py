"""The engine `compiled`: Adam's passes over a rollout in compiled loops, where `autograd` builds a graph a minibatch.

Minibatches and their order are those of the other engine; the rounding of a gradient step is not. Seeds learn one after
another. What has been compiled is kept on disk for the next process. Needs numba, of the extra `fast`.
"""

from __future__ import annotations

import functools
import importlib
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from threadpoolctl import ThreadpoolController
from torch import Tensor

from inbounds.learning.families.policy import Policy
from inbounds.learning.networks.actor_critic import ActorCritic
from inbounds.learning.networks.compiled_acting import CompiledActing as CompiledActing
from inbounds.learning.networks.compiling import ReadFromDisk, bound_to, kept_on_disk
from inbounds.learning.networks.kernels import AdamNumbers, Net, kernel
from inbounds.learning.networks.perceptron import Mlp
from inbounds.learning.rollout import Rollout
from inbounds.learning.updates import kernels
from inbounds.learning.updates.kernels import Batch, PPONumbers, Steps


class CompiledAdam:
    """Adam on the networks of one seed, and the passes over a rollout in which it serves.

    Args:
        networks: policy and value network, or the value network alone, of one seed.
        learning_rate: step size.
        eps: added to the root of the second moment.
        max_grad_norm: of the gradient over all networks; None never clips.

    Example:
        >>> adam = CompiledAdam([Mlp(1, (2, 3, 1))], learning_rate=0.1, eps=1e-8, max_grad_norm=None)
        >>> adam.state_dict()["steps"]
        0
    """

    def __init__(
        self, networks: Sequence[Mlp], learning_rate: float, eps: float, max_grad_norm: float | None
    ) -> None:
        self.networks = tuple(networks)
        self.steps = 0
        self._rows = [network.padded[0].numpy() for network in self.networks]  # [P] each
        self.dtype = self._rows[0].dtype
        max_norm = np.inf if max_grad_norm is None else max_grad_norm
        self._numbers = AdamNumbers(*map(self.dtype.type, (learning_rate, eps, max_norm)))
        self._moments = [(np.zeros_like(row), np.zeros_like(row)) for row in self._rows]

    def ppo_passes(
        self,
        policy: Policy,
        rollout: Rollout,
        advantage: Tensor,
        return_: Tensor,
        generator: np.random.Generator,
        config: Any,
    ) -> None:
        """Take all gradient steps of one PPO update, as `inbounds.learning.ppo.update` does.

        Args:
            policy: whose family has kernels.
            rollout: `[1, T, ...]`.
            advantage: `[1, T]`.
            return_: `[1, T]`.
            generator: draws the order of the minibatches.
            config: a `PPOConfig`.
        """
        number, limits = self.dtype.type, policy.config.limits
        numbers = PPONumbers(
            number(config.clip_range),
            number(config.entropy_coef),
            number(config.value_coef),
            config.normalize_advantage,
            not policy.config.state_dependent_std,
            tuple(map(number, (limits.log_std_min, limits.log_std_max, limits.concentration_max))),
        )
        order = _order(generator, rollout.horizon, config.num_epochs, config.minibatch_size)
        steps = _steps(rollout, advantage, return_)
        actor, critic = (self._net(i, config.minibatch_size) for i in range(2))
        batch = _batch(steps, config.minibatch_size)
        run = ppo_passes_of(str(policy.family.kernels))
        run(steps, actor, critic, batch, order, numbers, self._numbers, self.steps)
        self.steps += len(order)

    def value_passes(
        self,
        rollout: Rollout,
        return_: Tensor,
        generator: np.random.Generator,
        num_epochs: int,
        minibatch_size: int,
    ) -> None:
        """Take all gradient steps of one value regression, as `fit_values` does, on its last network."""
        order = _order(generator, rollout.horizon, num_epochs, minibatch_size)
        steps = _steps(rollout, return_, return_)
        critic = self._net(len(self.networks) - 1, minibatch_size)
        value_passes()(steps, critic, _batch(steps, minibatch_size), order, self._numbers, self.steps)
        self.steps += len(order)

    def _net(self, index: int, minibatch_size: int) -> Net:
        sizes = np.array(self.networks[index].sizes)
        room = (int(sizes[1:].sum()), minibatch_size)
        row = self._rows[index]
        return Net(
            row,
            np.zeros_like(row),
            *self._moments[index],
            sizes,
            units=np.empty(room, row.dtype),
            deltas=np.empty(room, row.dtype),
        )

    def state_dict(self) -> dict[str, Any]:
        """Return a copy of the moments and the step count."""
        return {"steps": self.steps, "moments": [[x.copy() for x in pair] for pair in self._moments]}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Go back to a state."""
        self.steps = state["steps"]
        for ours, theirs in zip(self._moments, state["moments"], strict=True):
            for array, stored in zip(ours, theirs, strict=True):
                array[:] = stored


class SeedBySeed:
    """The optimisers of S seeds that learn one after another, each as if it were alone.

    Args:
        networks: of S seeds.
        make_optimizer: of the algorithm.
        config: of the algorithm.
    """

    def __init__(self, networks: ActorCritic, make_optimizer: Callable[..., Any], config: Any) -> None:
        self._networks = [networks.seed(s) for s in range(networks.num_seeds)]
        self._of = [make_optimizer(network, config, CompiledAdam) for network in self._networks]

    def update(
        self,
        update: Callable[..., dict[str, Tensor]],
        rollout: Rollout,
        generators: Sequence[np.random.Generator],
        config: Any,
    ) -> dict[str, Tensor]:
        """Do an algorithm's update for each seed.

        Args:
            update: of the algorithm.
            rollout: `[S, T, ...]`.
            generators: one per seed.
            config: of the algorithm.

        Returns:
            The diagnostics `[S]`.
        """
        found = [
            update(network, optimizer, rollout.seed(s), [generator], config)
            for s, (network, optimizer, generator) in enumerate(
                zip(self._networks, self._of, generators, strict=True)
            )
        ]
        return {name: torch.cat([one[name] for one in found]) for name in found[0]}

    def state_dict(self) -> dict[str, Any]:
        """Return all states."""
        return {"seeds": [optimizer.state_dict() for optimizer in self._of]}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Go back to all states."""
        for optimizer, stored in zip(self._of, state["seeds"], strict=True):
            optimizer.load_state_dict(stored)


@functools.cache
def _libraries() -> ThreadpoolController:
    return ThreadpoolController()


def one_blas_thread() -> Any:
    """Return a context in which the matrix libraries of NumPy and SciPy use one thread: torch's setting is its own."""
    return _libraries().limit(limits=1, user_api="blas")


def _order(
    generator: np.random.Generator, horizon: int, num_epochs: int, minibatch_size: int
) -> NDArray[np.int64]:
    """Return which steps each minibatch has, `[N, B]`: the permutations that `minibatches` draws."""
    passes = [generator.permutation(horizon) for _ in range(num_epochs)]
    return np.concatenate(passes).reshape(-1, minibatch_size)


def _steps(rollout: Rollout, advantage: Tensor, return_: Tensor) -> Steps:
    columns = rollout.obs, rollout.latent, rollout.log_prob, advantage, return_
    return Steps(*(np.ascontiguousarray(column[0].numpy()) for column in columns))


def _batch(steps: Steps, size: int) -> Batch:
    obs_dim, act_dim = steps.obs.shape[1], steps.latent.shape[1]
    shapes = (obs_dim, size), (act_dim, size), size, size, size, size, (2 * act_dim, size)
    return Batch(*(np.empty(shape, steps.obs.dtype) for shape in shapes))


# ---- what is compiled


def make_ppo_passes(family: str) -> Any:
    """Return `kernels.ppo_passes` with the score and the entropy's slope of a family's kernels, to be compiled."""
    of_family = importlib.import_module(family)
    slope = bound_to(kernels.policy_slope, score=of_family.score, entropy_slope=of_family.entropy_slope)
    return kept_on_disk(bound_to(kernels.ppo_passes, policy_slope=kernel(slope)), kernels, of_family)


def make_value_passes() -> Any:
    """Return `kernels.value_passes`, to be compiled."""
    return kept_on_disk(kernels.value_passes, kernels)


@functools.cache
def ppo_passes_of(family: str) -> Callable[..., None]:
    """Return `kernels.ppo_passes` for the module of a family's kernels, compiled."""
    return ReadFromDisk(make_ppo_passes, family)


@functools.cache
def value_passes() -> Callable[..., None]:
    """Return `kernels.value_passes`, compiled."""
    return ReadFromDisk(make_value_passes)
