"""What a policy is worth without its noise, measured beside training and without touching it.

Evaluations have environments of their own and draw from generators of their own: from the seed's `SeedSequence`,
under spawn keys that training (`inbounds.learning.seeding`, keys 0 to 3) does not use. Observation statistics are read,
never updated. A run that is evaluated is, bit for bit, the run that is not.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from inbounds.learning import Trainer
from inbounds.learning.run_store import policies_of
from inbounds.learning.training import Environments, make_environments, one_thread

_STREAM = 4  # spawn keys below it are training's
_FINAL = 2**31  # in the place of an epoch: the evaluation of the finished policies
FINAL_EPISODES = 10

Act = Callable[[NDArray[Any]], NDArray[Any]]
"""Observations `[N, O]` to actions `[N, A]`."""


def generator_of(seed: int, epoch: int) -> np.random.Generator:
    """Return the generator of one seed's evaluation after an epoch; the same whenever it is asked for."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(_STREAM, epoch)))


def play(envs: Environments, act: Act, starts: Sequence[int]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Play one episode in each environment.

    Args:
        envs: N environments, `AutoresetMode.SAME_STEP`.
        act: the policy.
        starts: N seeds of the episodes' starts.

    Returns:
        Undiscounted returns `[N]` and lengths in env steps `[N]`.
    """
    seeds: Any = list(starts)  # Any: VectorEnv declares an integer, every vector environment takes a list
    obs, _ = envs.reset(seed=seeds)
    returns, lengths = np.zeros(len(starts)), np.zeros(len(starts), np.int64)
    playing = np.ones(len(starts), np.bool_)
    while playing.any():  # environments that are done go on, unheeded, until the last one is
        obs, reward, terminated, truncated, _ = envs.step(act(obs))
        returns[playing] += reward[playing]
        lengths[playing] += 1
        playing &= ~(terminated | truncated)
    return returns, lengths


class GreedyEvaluation:
    """Plays, after an epoch, one greedy episode of every seed of a run.

    The greedy action is the median of the action's law, for a family that offers none (beta) the mean.

    Args:
        trainer: the run.
    """

    def __init__(self, trainer: Trainer) -> None:
        self.trainer = trainer
        self.greedy = greedy_choice(trainer)
        self.envs = make_environments(trainer.config, len(trainer.config.seeds))

    def __call__(self, epoch: int) -> NDArray[Any]:
        """Return the returns `[S]`; NaN for a diverged seed."""
        starts = [int(generator_of(seed, epoch).integers(2**31)) for seed in self.trainer.config.seeds]
        with one_thread(), np.errstate(invalid="ignore"):
            returns, _ = play(self.envs, self._act, starts)
        return np.where(self.trainer.diverged, np.nan, returns)

    def _act(self, obs: NDArray[Any]) -> NDArray[Any]:
        collector, networks = self.trainer.collector, self.trainer.networks
        normalizer = collector.normalizer
        seen = obs.astype(collector.dtype) if normalizer is None else normalizer(obs)
        outputs = torch.from_numpy(networks.actor.act(seen))
        action = networks.policy.greedy(outputs, self.greedy).astype(collector.action_dtype)
        return np.where(np.isfinite(action), action, collector.centre)  # a diverged seed holds still

    def close(self) -> None:
        """Close the environments."""
        self.envs.close()


def greedy_choice(trainer: Trainer) -> str:
    """Return the greedy action that a run is evaluated by."""
    return "median" if "median" in trainer.networks.policy.family.greedy else "mean"


def evaluate_finally(trainer: Trainer, episodes: int = FINAL_EPISODES) -> list[dict[str, Any]]:
    """Play episodes of every seed's policy under each way to act that its family offers.

    Every way meets the same starts. Diverged seeds are left out.

    Args:
        trainer: the finished run.
        episodes: per seed and way.

    Returns:
        A row per seed, way and episode: `seed`, `greedy`, `episode`, `return`, `length`.
    """
    envs = make_environments(trainer.config, episodes)
    rows = []
    with one_thread():
        for policy in policies_of(trainer):
            if policy.diverged:
                continue
            starts = [int(s) for s in generator_of(policy.seed, _FINAL).integers(2**31, size=episodes)]
            for way in policy.greedy_choices:
                rng = generator_of(policy.seed, _FINAL + 1)
                act: Act = lambda obs, policy=policy, way=way, rng=rng: policy.act(obs, way, rng)  # type: ignore[misc]  # noqa: E731
                returns, lengths = play(envs, act, starts)
                rows += [
                    {"seed": policy.seed, "greedy": way, "episode": i, "return": r, "length": n}
                    for i, (r, n) in enumerate(zip(returns.tolist(), lengths.tolist(), strict=True))
                ]
    envs.close()
    return rows
