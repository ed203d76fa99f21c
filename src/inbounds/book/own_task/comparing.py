"""Does it work? A task of one's own: what needs no learning, what has learned, on days that nobody trained on.

    >>> import gymnasium
    >>> from gymnasium.vector import AutoresetMode, SyncVectorEnv
    >>> def pendulums(num_envs):
    ...     make = [lambda: gymnasium.make("Pendulum-v1")] * num_envs
    ...     return SyncVectorEnv(make, autoreset_mode=AutoresetMode.SAME_STEP)
    >>> returns = play(constant([0.0]), pendulums, range(5))
    >>> returns.shape, bool((returns < 0).all())
    ((5,), True)

An *actor* takes observations `[N, O]` and returns actions `[N, A]`. A *day* is an episode, named by the seed of its
reset.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from typing import Any, TypeAlias

import numpy as np
from gymnasium.vector import VectorEnv
from numpy.typing import ArrayLike, NDArray

from inbounds.learning import TrainedPolicy
from inbounds.study.statistics import Estimate, mean_of

__all__ = ["best_of", "compare", "constant", "greedy", "noisy", "play"]

Floats: TypeAlias = NDArray[np.float64]
Actor: TypeAlias = Callable[[NDArray[Any]], NDArray[Any]]
MakeEnvs: TypeAlias = Callable[[int], VectorEnv[Any, Any, Any]]
"""Makes a vector environment for a number of episodes at once."""


def constant(action: ArrayLike) -> Actor:
    """Return an actor that always does the same.

    Args:
        action: `[A]` in the box's units.

    Example:
        >>> constant([1.0, 0.5])(np.zeros((3, 2))).shape
        (3, 2)
    """
    row = np.asarray(action, np.float32)
    return lambda obs: np.tile(row, (len(obs), 1))


def greedy(policy: TrainedPolicy) -> Actor:
    """Return a trained policy that takes its greedy action, the median of its law."""
    return policy.act


def noisy(policy: TrainedPolicy, seed: int = 0) -> Actor:
    """Return a trained policy that draws, as it did in training.

    Args:
        policy: which.
        seed: of the draws.
    """
    rng = np.random.default_rng(seed)
    return lambda obs: policy.act(obs, "sample", rng)


def play(act: Actor, make_envs: MakeEnvs, days: Sequence[int], limit: int = 100_000) -> Floats:
    """Return what one actor earns on each of some days `[N]`, undiscounted.

    Args:
        act: who acts.
        make_envs: makes the environments; they reset within the step that ends an episode, as for training.
        days: seeds of the resets, one a day.
        limit: of steps in a day.

    Raises:
        RuntimeError: some day is not over after so many steps.

    Example:
        >>> import gymnasium
        >>> from gymnasium.vector import AutoresetMode, SyncVectorEnv
        >>> from inbounds.book.own_task import constant
        >>> make = lambda: gymnasium.make("MountainCarContinuous-v0")
        >>> envs = lambda n: SyncVectorEnv([make] * n, autoreset_mode=AutoresetMode.SAME_STEP)
        >>> play(constant([0.0]), envs, [0, 1])
        array([0., 0.])
    """
    earned, running = np.zeros(len(days)), np.ones(len(days), np.bool_)
    with closing(make_envs(len(days))) as envs:
        obs, _ = envs.reset(seed=list(days))  # type: ignore[arg-type]  # every vector environment takes a list
        for _ in range(limit):
            obs, reward, terminated, truncated, _ = envs.step(act(obs))
            earned += np.where(running, reward, 0.0)
            running &= ~(terminated | truncated)
            if not running.any():
                return earned
    raise RuntimeError(
        f"after {limit} steps {running.sum()} of {len(days)} episodes go on: no end, no return"
    )


def best_of(
    actors: Mapping[str, Actor], make_envs: MakeEnvs, days: Sequence[int]
) -> tuple[str, dict[str, float]]:
    """Return the name of the actor that earns most on some days, and what each earns there in the mean.

    Args:
        actors: by name.
        make_envs: as in `play`.
        days: for choosing; whoever is chosen by them is compared on others.

    Example:
        >>> import gymnasium
        >>> from gymnasium.vector import AutoresetMode, SyncVectorEnv
        >>> from inbounds.book.own_task import constant
        >>> make = lambda: gymnasium.make("Pendulum-v1")
        >>> envs = lambda n: SyncVectorEnv([make] * n, autoreset_mode=AutoresetMode.SAME_STEP)
        >>> still, pushed = constant([0.0]), constant([2.0])
        >>> best_of({"still": still, "pushed": pushed}, envs, range(20))[0] in ("still", "pushed")
        True
    """
    earned = {name: float(play(act, make_envs, days).mean()) for name, act in actors.items()}
    return max(earned, key=earned.__getitem__), earned


def compare(returns: Mapping[str, Floats], rival: str) -> dict[str, tuple[Estimate, Estimate | None]]:
    """Return each one's mean return, and its lead over a rival that has no seeds, with 95 % intervals.

    Args:
        returns: by name: `[N]` of one actor on N days, or `[S, N]` of the policies of S seeds on the same days.
        rival: a name of theirs, with returns `[N]`.

    Returns:
        Mean and lead of each name. Policies are resampled by seed (another training run, the same days). One actor is
        resampled by day, and its lead is paired day by day. The rival's own lead is None. An interval is the
        same whoever else is there.

    Raises:
        ValueError: the rival has seeds, or the days are not the same for all.

    Example:
        >>> import numpy as np
        >>> rng = np.random.default_rng(0)
        >>> found = compare({"rule": rng.normal(5, 1, 40), "policies": rng.normal(7, 1, (10, 40))}, "rule")
        >>> mean, lead = found["policies"]
        >>> bool(lead.low > 1), found["rule"][1] is None
        (True, True)
    """
    theirs = returns[rival]
    if theirs.ndim != 1:
        raise ValueError(f"{rival} has seeds: a rival is one program, which earns one number a day")

    def over(values: Floats) -> Estimate:
        return mean_of(values.mean(1) if values.ndim == 2 else values)

    found: dict[str, tuple[Estimate, Estimate | None]] = {}
    for name, values in returns.items():
        if values.shape[-1] != len(theirs):
            raise ValueError(
                f"{name} has {values.shape[-1]} days, {rival} {len(theirs)}: play them on the same"
            )
        found[name] = over(values), None if name == rival else over(values - theirs)
    return found
