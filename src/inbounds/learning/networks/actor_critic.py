"""The networks of a run: a policy and a value network per seed, built, initialised and read by a `Policy`."""

from __future__ import annotations

import copy
import operator
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, Self

import torch
from torch import Tensor

from inbounds.learning.families.family import Parameters
from inbounds.learning.families.initial_noise import head_bias
from inbounds.learning.families.policy import Policy
from inbounds.learning.networks.perceptron import (
    Mlp,
    SeedLinear,
    initialize_orthogonal,
    initialize_pytorch,
    mlp,
)
from inbounds.learning.updates.checks import check

DTYPES = {"float32": torch.float32, "float64": torch.float64}


@dataclass(frozen=True)
class NetworkConfig:
    """Shape and first weights of the policy and the value network, which share nothing.

    Example:
        >>> NetworkConfig(hidden_sizes=(256, 256)).initialization
        'orthogonal'
    """

    hidden_sizes: tuple[int, ...] = (64, 64)
    """Units of the hidden layers, tanh between them."""
    initialization: Literal["pytorch", "orthogonal"] = "orthogonal"
    """pytorch: uniform on ±1/√in, biases too. orthogonal: gain √2, heads as below, biases zero."""
    policy_head_gain: float = 0.01
    """Gain of the policy's last layer (orthogonal only)."""
    value_head_gain: float = 1.0
    """Gain of the value's last layer (orthogonal only)."""
    dtype: Literal["float32", "float64"] = "float32"
    """Of weights, observations and latents; physics is float64 in any case."""

    def __post_init__(self) -> None:
        try:  # a list is equal to the tuple that a file gives back, and a number of units is whole
            object.__setattr__(self, "hidden_sizes", tuple(map(operator.index, self.hidden_sizes)))
        except TypeError:
            raise ValueError(
                f"hidden_sizes must be whole numbers of units, one a layer, got {self.hidden_sizes!r}"
            ) from None
        if not self.hidden_sizes or min(self.hidden_sizes) < 1:
            raise ValueError(f"hidden_sizes needs positive numbers of units, got {self.hidden_sizes}")
        if self.initialization not in ("pytorch", "orthogonal"):
            raise ValueError(f"initialization must be pytorch or orthogonal, got {self.initialization!r}")
        if self.dtype not in tuple(DTYPES):  # a list has no hash
            raise ValueError(f"dtype must be float32 or float64, got {self.dtype!r}")
        check(self, finite=("policy_head_gain", "value_head_gain"))


class ActorCritic:
    """A policy and a value network for each of S seeds.

    Args:
        policy: the family and the box.
        obs_dim: numbers of an observation, O.
        config: shape and initialisation.
        generators: one torch generator per seed; each draws its own policy network, then its value network.

    Example:
        >>> import numpy as np
        >>> import torch
        >>> from inbounds.learning import NetworkConfig, Policy, PolicyConfig
        >>> policy = Policy(PolicyConfig("gaussian"), low=-np.ones(2), high=np.ones(2))
        >>> nets = ActorCritic(policy, 3, NetworkConfig(), [torch.Generator().manual_seed(s) for s in range(5)])
        >>> nets.outputs(torch.zeros(5, 7, 3)).shape, nets.values(torch.zeros(5, 7, 3)).shape
        (torch.Size([5, 7, 4]), torch.Size([5, 7]))
    """

    def __init__(
        self, policy: Policy, obs_dim: int, config: NetworkConfig, generators: Sequence[torch.Generator]
    ) -> None:
        self.policy = policy
        self.dtype = DTYPES[config.dtype]
        num_seeds = len(generators)
        hidden = config.hidden_sizes
        self.actor = Mlp(num_seeds, (obs_dim, *hidden, 2 * policy.act_dim), self.dtype)
        self.critic = Mlp(num_seeds, (obs_dim, *hidden, 1), self.dtype)
        if config.initialization == "orthogonal":
            initialize_orthogonal(self.actor, generators, config.policy_head_gain)
            initialize_orthogonal(self.critic, generators, config.value_head_gain)
        else:
            initialize_pytorch(self.actor, generators)
            initialize_pytorch(self.critic, generators)
        self._prepare_head()

    def _prepare_head(self) -> None:
        """Match the initial noise, and cut log σ off from the state, where the configuration says so."""
        head, act_dim = self.actor.layers[-1], self.policy.act_dim
        config = self.policy.config
        self._loc_rows: Tensor | None = None
        with torch.no_grad():
            if (bias := head_bias(config)) is not None:
                head.bias[:, :act_dim], head.bias[:, act_dim:] = bias
            if not config.state_dependent_std:
                # A row of zeros times the features leaves the bias: one free log σ per dimension. Masking in the
                # graph keeps the zeros zero under every optimiser and every derivative.
                self._loc_rows = torch.ones(2 * act_dim, 1, dtype=self.dtype)
                self._loc_rows[act_dim:] = 0
                head.weight.mul_(self._loc_rows)
                if bias is None:
                    head.bias[:, act_dim:] = 0

    @property
    def num_seeds(self) -> int:
        """S."""
        return len(self.actor.theta)

    def seed(self, index: int) -> Self:
        """Return the two networks of one seed, S = 1, which have their weights in common with these.

        Raises:
            IndexError: there are fewer seeds; negative indices count from the end.
        """
        one = copy.copy(self)
        one.actor, one.critic = self.actor.seed(index), self.critic.seed(index)
        return one

    @property
    def networks(self) -> tuple[Mlp, Mlp]:
        """The policy network and the value network."""
        return self.actor, self.critic

    def outputs(self, obs: Tensor) -> Tensor:
        """Return the policy network's outputs `[S, B, 2A]` for observations `[S, B, O]`."""
        layers = self.actor.layers
        if self._loc_rows is not None:
            head = layers[-1]
            layers = [*layers[:-1], SeedLinear(head.weight * self._loc_rows, head.bias)]
        return mlp(layers, obs)

    def parameters(self, obs: Tensor) -> Parameters:
        """Return the parameters `[S, B, A]` of the law in each state `[S, B, O]`."""
        return self.policy.parameters(self.outputs(obs))

    def values(self, obs: Tensor) -> Tensor:
        """Return the value network's estimates `[S, B]` for observations `[S, B, O]`."""
        return self.critic(obs)[..., 0]

    def finite(self) -> Tensor:
        """Return, for each seed, whether all its weights are finite: `[S]` booleans."""
        return torch.isfinite(self.actor.theta).all(1) & torch.isfinite(self.critic.theta).all(1)

    def state_dict(self) -> dict[str, Any]:
        """Return the weights."""
        return {"actor": self.actor.theta.clone(), "critic": self.critic.theta.clone()}

    def check_state_dict(self, state: dict[str, Any]) -> None:
        """Refuse weights of other networks.

        Raises:
            ValueError: they are of other observations or actions.
        """
        if state["actor"].shape != self.actor.theta.shape or state["critic"].shape != self.critic.theta.shape:
            raise ValueError(
                "the environment's observations or actions have another size than when the run began: "
                "use that environment, or another run directory"
            )

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Go back to weights from `state_dict`.

        Raises:
            ValueError: they are of other observations or actions.
        """
        self.check_state_dict(state)
        self.actor.theta.copy_(state["actor"])
        self.critic.theta.copy_(state["critic"])
