"""The whole description of a run, and the two presets."""

from __future__ import annotations

import dataclasses
import operator
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from types import ModuleType
from typing import Literal, TypeAlias

import numpy as np

from inbounds.learning import policy_gradient, ppo, trpo
from inbounds.learning.families.policy import PolicyConfig
from inbounds.learning.networks.actor_critic import NetworkConfig
from inbounds.learning.policy_gradient import PolicyGradientConfig
from inbounds.learning.ppo import PPOConfig
from inbounds.learning.trpo import TRPOConfig
from inbounds.learning.updates.checks import check

AlgorithmConfig: TypeAlias = PPOConfig | TRPOConfig | PolicyGradientConfig

ALGORITHMS: dict[str, tuple[type[AlgorithmConfig], ModuleType]] = {
    "ppo": (PPOConfig, ppo),
    "trpo": (TRPOConfig, trpo),
    "policy-gradient": (PolicyGradientConfig, policy_gradient),
}
"""By name: the configuration, and the module with `make_optimizer` and `update`."""


@dataclass(frozen=True)
class TrainConfig:
    """Everything that decides what a run does. Two runs with one configuration are the same run, bit for bit.

    Example:
        >>> from inbounds.learning import TRPOConfig
        >>> config = TrainConfig("Hopper-v5", seeds=(0, 1), algorithm=TRPOConfig(max_kl=0.02))
        >>> config.algorithm_name, config.policy.family, config.epochs
        ('trpo', 'logit-normal', 500)
    """

    env: str = "HalfCheetah-v5"
    """One of the robots of `inbounds.robots`, or any id that `gymnasium.make` knows."""
    seeds: tuple[int, ...] = tuple(range(10))
    """Trained in lockstep; none notices the others."""
    epochs: int = 500
    """Rollouts, each followed by one update."""
    algorithm: AlgorithmConfig = field(default_factory=PPOConfig)
    """PPO, TRPO or REINFORCE with a baseline, with all its numbers."""
    policy: PolicyConfig = field(default_factory=PolicyConfig)
    """The family and how network outputs become its parameters."""
    network: NetworkConfig = field(default_factory=NetworkConfig)
    """Shape, first weights and precision."""
    normalize_obs: bool = True
    """Normalise observations by running statistics, per seed."""
    action_mode: Literal["clip", "raw"] = "clip"
    """clip: to the box, before robot and reward see the action. raw: as it was drawn."""
    engine: Literal["autograd", "compiled"] = "autograd"
    """autograd: PyTorch's, which the book reads. compiled: the same update in compiled loops, faster; needs the extra
    `fast`. Their gradient steps differ in the last bits, so that their runs part."""
    checkpoint_every: int = 10
    """Epochs between checkpoints, where a run directory is given; the last epoch always has one."""

    def __post_init__(self) -> None:
        if not isinstance(self.env, str) or not self.env:
            raise ValueError(f"env must be the id of an environment, got {self.env!r}")
        algorithms = tuple(kind for kind, _ in ALGORITHMS.values())
        for name, kinds in (
            ("algorithm", algorithms),
            ("policy", (PolicyConfig,)),
            ("network", (NetworkConfig,)),
        ):
            if not isinstance(given := getattr(self, name), kinds):
                wanted = " or a ".join(kind.__name__ for kind in kinds)
                raise TypeError(f"{name} must be a {wanted}, got {given!r}; `preset` takes names")
        if isinstance(self.seeds, int | np.integer):
            raise TypeError(f"seeds must be a sequence, got {self.seeds}; `preset` takes a number of seeds")
        try:
            object.__setattr__(self, "seeds", tuple(map(operator.index, self.seeds)))  # NumPy's integers, too
        except TypeError:
            raise TypeError(f"seeds must be a sequence of integers, got {self.seeds!r}") from None
        check(self, positive=("epochs", "checkpoint_every"))
        if (
            not self.seeds
            or len(set(self.seeds)) < len(self.seeds)
            or not 0 <= min(self.seeds) <= max(self.seeds) < 2**63
        ):
            raise ValueError(
                f"seeds must be different, non-negative integers below 2⁶³, at least one; got {self.seeds}"
            )
        if self.engine not in ("autograd", "compiled"):
            raise ValueError(f"engine must be autograd or compiled, got {self.engine!r}")
        if self.action_mode not in ("clip", "raw"):
            raise ValueError(f"action_mode must be clip or raw, got {self.action_mode!r}")

    @property
    def algorithm_name(self) -> str:
        """ppo, trpo or policy-gradient."""
        return next(name for name, (kind, _) in ALGORITHMS.items() if isinstance(self.algorithm, kind))


def preset(
    name: Literal["common", "as-printed"],
    env: str = "HalfCheetah-v5",
    *,
    policy: str = "logit-normal",
    algo: str = "ppo",
    seeds: int | Sequence[int] = 10,
    epochs: int = 500,
) -> TrainConfig:
    """Return a configuration with every number explicit.

    `common` is what public implementations have settled on (Engstrom et al. 2020; Andrychowicz et al. 2021; Huang et
    al. 2022), with three things as the first study has them: a σ that depends on the state, for the Gaussian, too; an
    entropy bonus of 10⁻⁴; a step size that stays. Each family has its usual start: `PolicyConfig.initial_std` makes it
    quiet. `as-printed` is the source thesis' tables to the letter, PPO's ε = 0.02 included, and no practice that it
    does not mention. What neither states (conjugate gradients, damping, line search) is the same in both.

    Args:
        name: "common" or "as-printed".
        env: id of the environment.
        policy: gaussian, clipped-gaussian, beta or logit-normal.
        algo: ppo, trpo or policy-gradient.
        seeds: how many (0, 1, …), or which.
        epochs: rollouts, each followed by one update.

    Returns:
        The configuration; change it with `dataclasses.replace`.

    Raises:
        ValueError: no preset, algorithm or family of that name; no seed, or a number below one of them.
        TypeError: `seeds` is neither a number nor several.

    Example:
        >>> config = preset("as-printed", "Hopper-v5", policy="beta", seeds=3)
        >>> config.algorithm.clip_range, config.network.initialization, config.seeds
        (0.02, 'pytorch', (0, 1, 2))
    """
    if algo not in tuple(ALGORITHMS):  # a list has no hash
        raise ValueError(f"no algorithm {algo!r}; choose one of {', '.join(ALGORITHMS)}")
    several = (
        isinstance(seeds, Iterable) and not isinstance(seeds, str | bytes) and getattr(seeds, "ndim", 1) == 1
    )
    if isinstance(seeds, bool) or not (several or isinstance(seeds, int | np.integer)):
        raise TypeError(f"seeds is how many (10), or which ((3, 7)); got {seeds!r}")
    if isinstance(seeds, int | np.integer):
        if seeds < 1:
            raise ValueError(
                f"seeds={seeds} asks for {seeds} of them; at least 1, or say which: seeds=(3, 7)"
            )
        seeds = range(seeds)
    common = TrainConfig(
        env=env,
        seeds=tuple(seeds),
        epochs=epochs,
        algorithm=ALGORITHMS[algo][0](),
        policy=PolicyConfig(policy),
    )
    if name == "common":
        return common
    if name != "as-printed":
        raise ValueError(f"no preset {name!r}; choose common or as-printed")
    algorithm = dataclasses.replace(
        common.algorithm, adam_eps=1e-8, normalize_advantage=False, max_grad_norm=None
    )
    if isinstance(algorithm, PPOConfig):
        algorithm = dataclasses.replace(algorithm, clip_range=0.02)
    return dataclasses.replace(
        common,
        algorithm=algorithm,
        network=NetworkConfig(initialization="pytorch"),
        normalize_obs=False,
    )
