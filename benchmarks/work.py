"""The work that every contestant does: one environment per seed, a rollout, ten epochs of minibatches."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable
from dataclasses import dataclass

ENVS = ("Hopper-v5", "HalfCheetah-v5", "Ant-v5", "Humanoid-v5")


@dataclass(frozen=True)
class Work:
    """One epoch of training: the same numbers for all."""

    env: str
    """Gymnasium's id."""
    horizon: int = 2048
    """Env steps of each seed's rollout."""
    num_epochs: int = 10
    """Passes over the rollout."""
    minibatch_size: int = 64
    """Env steps of each seed in a gradient step."""
    hidden: tuple[int, int] = (64, 64)
    """Units of the two hidden layers of the policy and of the value network, tanh between them."""
    learning_rate: float = 3e-4
    gamma: float = 0.99
    gae_lambda: float = 0.95
    max_grad_norm: float = 0.5
    max_kl: float = 0.01
    """TRPO's δ, in nats."""
    cg_iters: int = 10
    """TRPO's iterations of the conjugate gradients."""


def multiply_adds(sizes: tuple[int, ...]) -> int:
    """Return the multiply-adds of one sample's way through a perceptron.

    Example:
        >>> multiply_adds((11, 64, 64, 1))
        4864
    """
    return sum(a * b for a, b in itertools.pairwise(sizes))


def flops_per_step(work: Work, obs_dim: int, act_dim: int) -> int:
    """Return the floating-point operations of the networks per env step of PPO: what no implementation can leave out.

    A forward pass takes 2 operations per multiply-add, the gradient by the weights 2 more, the gradient by the
    activations 2 more but for the first layer, whose inputs need none. Each step is acted on once by the policy,
    valued once, and learned from `num_epochs` times by both networks.

    Args:
        work: the numbers.
        obs_dim: O.
        act_dim: A; the policy has 2 A outputs.

    Returns:
        Operations per env step.

    Example:
        >>> flops_per_step(Work("Hopper-v5"), obs_dim=11, act_dim=3)
        594816
    """
    policy = multiply_adds((obs_dim, *work.hidden, 2 * act_dim))
    value = multiply_adds((obs_dim, *work.hidden, 1))
    first = 2 * obs_dim * work.hidden[0]  # of both networks
    return 2 * (policy + value) + work.num_epochs * (6 * (policy + value) - 2 * first)


def stopwatch() -> Callable[[], dict[str, float]]:
    """Return what tells the seconds since now, by the clock on the wall and by this process's share of the processor.

    On a machine that does nothing else the two agree; elsewhere the second is the steadier.

    Example:
        >>> sorted(stopwatch()())
        ['cpu_seconds', 'seconds']
    """
    wall, cpu = time.perf_counter(), time.process_time()
    return lambda: {"seconds": time.perf_counter() - wall, "cpu_seconds": time.process_time() - cpu}
