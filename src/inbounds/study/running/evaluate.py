"""What a policy is worth without its noise, measured beside training and without touching it.

Evaluations have environments of their own and draw from generators of their own: from the seed's `SeedSequence`,
under spawn keys that training (`inbounds.learning.seeding`, keys 0 to 3) does not use. Observation statistics are read,
never updated. A run that is evaluated is, bit for bit, the run that is not.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from inbounds.learning import Trainer
from inbounds.learning.training import Environments, make_environments
from inbounds.learning.updates.threads import one_thread

_STREAM = 4  # spawn keys below it are training's
FINAL = 2**31
"""In the place of an epoch: the evaluation of the finished policies."""
FINAL_EPISODES = 10
GREEDY = "median"  # how policies act while they are trained

Act = Callable[[NDArray[Any]], NDArray[Any]]
"""Observations `[N, O]` to actions `[N, A]`."""


def generator_of(seed: int, epoch: int) -> np.random.Generator:
    """Return the generator of one seed's evaluation after an epoch: the same whenever it is asked for."""
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


class Players:
    """The policies of a run, as they stand, in environments of their own: S seeds × E episodes side by side.

    Args:
        trainer: the run.
        episodes: E, of each seed.
    """

    def __init__(self, trainer: Trainer, episodes: int = 1) -> None:
        self.trainer, self.episodes = trainer, episodes
        self.envs = make_environments(trainer.config, len(trainer.config.seeds) * episodes)

    def play(
        self, way: str, starts: Sequence[int], generators: Sequence[np.random.Generator] = ()
    ) -> tuple[NDArray[Any], NDArray[Any]]:
        """Play E episodes of each seed.

        Args:
            way: to act: "mean", "median", "mode" or "sample".
            starts: S·E seeds of the episodes' starts, those of a policy in a row.
            generators: one per policy, for "sample".

        Returns:
            Returns and lengths, `[S, E]` each; NaN returns for a diverged seed.
        """
        draws = [generator for generator in generators for _ in range(self.episodes)]
        with one_thread(), torch.no_grad(), np.errstate(invalid="ignore"):
            returns, lengths = play(self.envs, lambda obs: self._act(obs, way, draws), starts)
        shape = (len(self.trainer.config.seeds), self.episodes)
        returns = np.where(self.trainer.diverged[:, None], np.nan, returns.reshape(shape))
        return returns, lengths.reshape(shape)

    def _act(self, obs: NDArray[Any], way: str, generators: Sequence[np.random.Generator]) -> NDArray[Any]:
        policy, outputs = self.trainer.networks.policy, self._outputs(obs)
        if way == "sample":
            return policy.sample(outputs.numpy(), generators, self.trainer.collector.action_mode)
        return policy.greedy(outputs, way)

    def _outputs(self, obs: NDArray[Any]) -> torch.Tensor:
        """Return the networks' outputs `[S·E, 2A]` for observations `[S·E, O]`."""
        collector, networks = self.trainer.collector, self.trainer.networks
        by_seed = obs.reshape(-1, self.episodes, obs.shape[1]).swapaxes(
            0, 1
        )  # [E, S, O], as statistics broadcast
        normalizer = collector.normalizer
        seen = by_seed.astype(collector.dtype) if normalizer is None else normalizer(by_seed)
        return networks.outputs(torch.from_numpy(seen.swapaxes(0, 1))).flatten(0, 1)

    def close(self) -> None:
        """Close the environments."""
        self.envs.close()


class GreedyEvaluation:
    """Plays, after an epoch, one greedy episode of every seed of a run.

    The greedy action is the median of the action's law: of mean, median and mode the one that a bijection of the
    action leaves in place. The start depends on seed and epoch alone: every cell meets the same.

    Args:
        trainer: the run.
    """

    def __init__(self, trainer: Trainer) -> None:
        self.seeds = trainer.config.seeds
        self.players = Players(trainer)

    def __call__(self, epoch: int) -> NDArray[Any]:
        """Return the returns `[S]`; NaN for a diverged seed."""
        starts = [int(generator_of(seed, epoch).integers(2**31)) for seed in self.seeds]
        return self.players.play(GREEDY, starts)[0][:, 0]


def evaluate_finally(trainer: Trainer, episodes: int = FINAL_EPISODES) -> list[dict[str, Any]]:
    """Play episodes of every seed's policy under each way to act that its family offers.

    Every way meets the same starts.

    Args:
        trainer: the finished run.
        episodes: per seed and way.

    Returns:
        A row per seed, way and episode: `seed`, `greedy`, `episode`, `return`, `length`.
    """
    seeds, rows = trainer.config.seeds, []
    starts = [
        int(start) for seed in seeds for start in generator_of(seed, FINAL).integers(2**31, size=episodes)
    ]
    with closing(Players(trainer, episodes)) as players:
        for way in (*trainer.networks.policy.family.greedy, "sample"):
            returns, lengths = players.play(way, starts, [generator_of(seed, FINAL + 1) for seed in seeds])
            rows += [
                {
                    "seed": seed,
                    "greedy": way,
                    "episode": e,
                    "return": returns[s, e],
                    "length": int(lengths[s, e]),
                }
                for s, seed in enumerate(seeds)
                for e in range(episodes)
            ]
    return rows
