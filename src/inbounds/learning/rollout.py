"""Acting: S policies in S environments, T steps, and what they saw.

Acting is plain NumPy, a few microseconds per step; values and log-probabilities are computed once, after
the rollout, from whole arrays. The environments must reset within the step that ends an episode
(`AutoresetMode.SAME_STEP`), which leaves no dummy transition in the data and hands over the final observation.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
import torch
from gymnasium.vector import AutoresetMode, VectorEnv
from numpy.typing import NDArray
from torch import Tensor

from inbounds.distributions.boxes import require_box
from inbounds.learning.advantages import gae
from inbounds.learning.families.family import Parameters
from inbounds.learning.families.policy import SATURATION_MARGIN, ActionMode
from inbounds.learning.networks.actor_critic import ActorCritic
from inbounds.learning.networks.normalizer import RunningNormalizer
from inbounds.learning.networks.perceptron import row_of_seed
from inbounds.learning.seeding import SeedStreams, generator_states, restore_generators

if TYPE_CHECKING:  # numba is an extra
    from inbounds.learning.networks.compiled_acting import CompiledActing


@dataclass(frozen=True)
class Rollout:
    """T steps of S seeds.

    Drawn by `Collector`, which has an example.
    """

    obs: Tensor
    """`[S, T, O]` as the networks saw it (normalised, if the run normalises)."""
    latent: Tensor
    """`[S, T, A]` what the law drew. Never reconstructed from the action, which may have lost it."""
    action: Tensor
    """`[S, T, A]` what was executed, in the robot's units."""
    reward: Tensor
    """`[S, T]` undiscounted, unscaled."""
    terminated: Tensor
    """`[S, T]` booleans: the episode ended by itself after this step."""
    truncated: Tensor
    """`[S, T]` booleans: the episode was cut off after this step."""
    bootstrap: Tensor
    """`[S, T]` V of the observation after a truncated and after the last step, else 0; not read where it terminated."""
    value: Tensor
    """`[S, T]` value of `obs`."""
    log_prob: Tensor
    """`[S, T]` log-density of `latent`, in nats."""
    parameters: Parameters
    """`[S, T, A]` each: the law that drew `latent`."""
    saturation: NDArray[Any]
    """`[S]` fraction of executed action components at a bound (within 0.1 % of half the range)."""
    action_std: NDArray[Any]
    """`[S]` standard deviation of the executed actions over the rollout, root mean square over dimensions, in units
    of half the range."""
    episode_returns: Sequence[Sequence[float]]
    """For each seed, the returns of the episodes that ended within the rollout."""

    @property
    def num_seeds(self) -> int:
        """S."""
        return self.reward.shape[0]

    @property
    def horizon(self) -> int:
        """T."""
        return self.reward.shape[1]

    def seed(self, index: int) -> Rollout:
        """Return a copy of one seed's steps, S = 1; an IndexError where there are fewer seeds (−1 is the last)."""
        row = row_of_seed(index, self.num_seeds)
        values = dict(vars(self))
        parameters = values.pop("parameters").each(lambda x: x[row].clone())
        for name, value in values.items():
            own = value[row]
            values[name] = own.clone() if isinstance(own, Tensor) else copy.deepcopy(own)
        return Rollout(**values, parameters=parameters)

    def advantages(self, gamma: float, gae_lambda: float) -> tuple[Tensor, Tensor]:
        """Return advantages and returns, `[S, T]` each: `gae` of this rollout."""
        return gae(
            self.reward, self.value, self.terminated, self.truncated, self.bootstrap, gamma, gae_lambda
        )


class Collector:
    """The acting side of a run: environments, generators, statistics, and where each episode stands.

    Args:
        envs: one environment per seed, `AutoresetMode.SAME_STEP`, bounded one-dimensional Box of actions.
        networks: the policies that act and the values that judge.
        streams: the generators of each seed.
        normalize_obs: keep running statistics and show the networks normalised observations.
        action_mode: "clip" actions to the box before the environment sees them, or pass them "raw".
        acting: of the engine `compiled`, under which values and log-densities, too, are a seed's own matter; None acts
            and evaluates in NumPy and torch, all seeds side by side.

    Raises:
        ValueError: the environments reset in another way, are not as many as the seeds, or have no Boxes of the
            kind that `check_environments` asks for.

    Example:
        >>> from inbounds.learning import Trainer, preset
        >>> collector = Trainer(preset("common", "Hopper-v5", seeds=2)).collector
        >>> rollout = collector.collect(64)
        >>> tuple(rollout.obs.shape), tuple(rollout.latent.shape)
        ((2, 64, 11), (2, 64, 3))
    """

    def __init__(
        self,
        envs: VectorEnv[Any, Any, Any],
        networks: ActorCritic,
        streams: Sequence[SeedStreams],
        normalize_obs: bool,
        action_mode: ActionMode = "clip",
        acting: CompiledActing | None = None,
    ) -> None:
        check_environments(envs, len(streams), action_mode)
        self.envs, self.networks, self.policy = envs, networks, networks.policy
        self.streams, self.action_mode, self._acting = streams, action_mode, acting
        self._act, self._judge = networks.actor.act, networks.critic.act
        if acting is not None:
            self._act, self._judge = acting.policy, acting.value
        self.dtype = np.dtype(str(networks.dtype).removeprefix("torch."))
        self.obs_dim = gymnasium.spaces.flatdim(envs.single_observation_space)
        self.normalizer = RunningNormalizer(len(streams), self.obs_dim, self.dtype) if normalize_obs else None
        self.returns = np.zeros(len(streams))  # of the episodes under way
        self.restart()

    def restart(self, seeds: Sequence[int] | None = None) -> None:
        """Start new episodes everywhere.

        Args:
            seeds: `[S]` of the environments; None takes each seed's own, with which a run begins.
        """
        # Any: VectorEnv declares an integer, every vector environment takes a list.
        chosen: Any = [stream.environment for stream in self.streams] if seeds is None else list(seeds)
        obs, _ = self.envs.reset(seed=chosen)
        self.obs = self._see(obs)
        self.returns[:] = 0

    def collect(self, horizon: int) -> Rollout:
        """Act for T steps and return what happened.

        Args:
            horizon: T, in env steps per seed.

        Returns:
            The rollout; episodes under way go on in the next one.
        """
        num_seeds, act_dim = len(self.streams), self.policy.act_dim
        draw = self.policy.law.sampler([s.noise for s in self.streams], horizon, act_dim, self.dtype)
        obs = np.empty((num_seeds, horizon, self.obs_dim), self.dtype)
        latent = np.empty((num_seeds, horizon, act_dim), self.dtype)
        action = np.empty((num_seeds, horizon, act_dim), self.policy.dtype)
        reward = np.empty((num_seeds, horizon))
        terminated = np.empty((num_seeds, horizon), np.bool_)
        truncated = np.empty((num_seeds, horizon), np.bool_)
        bootstrap = np.zeros((num_seeds, horizon), self.dtype)
        episode_returns: list[list[float]] = [[] for _ in range(num_seeds)]
        with np.errstate(invalid="ignore"):  # a diverged seed computes with NaN, in silence
            for t in range(horizon):
                obs[:, t] = self.obs
                parameters = self.policy.parameters(self._act(self.obs), np)
                latent[:, t] = z = draw(parameters, t)
                action[:, t] = executed = self.policy.execute(z, self.action_mode)
                next_obs, reward[:, t], terminated[:, t], truncated[:, t], info = self.envs.step(executed)
                self.returns += reward[:, t]
                if (over := terminated[:, t] | truncated[:, t]).any():
                    self._end_episodes(over, episode_returns)
                    if truncated[:, t].any():
                        bootstrap[:, t] = self._final_values(truncated[:, t], info)
                self.obs = self._see(next_obs)
            last = self._judge(self.obs)[:, 0]
        bootstrap[:, -1] = np.where(truncated[:, -1], bootstrap[:, -1], last)
        return self._rollout(
            obs, latent, action, reward, terminated, truncated, bootstrap, episode_returns=episode_returns
        )

    def _see(self, obs: NDArray[Any]) -> NDArray[Any]:
        """Return observations as the networks see them, `[S, O]`, taking them into the statistics."""
        obs = np.reshape(obs, (len(self.streams), -1))
        if self.normalizer is None:
            return obs.astype(self.dtype)
        if self._acting is not None:
            return self._acting.see(self.normalizer, obs)
        self.normalizer.update(obs)
        return self.normalizer(obs)

    def _end_episodes(self, over: NDArray[np.bool_], episode_returns: list[list[float]]) -> None:
        for s in np.flatnonzero(over):
            episode_returns[s].append(float(self.returns[s]))
        self.returns[over] = 0

    def _final_values(self, truncated: NDArray[np.bool_], info: dict[str, Any]) -> NDArray[Any]:
        """Return the values `[S]` of the final observations of truncated episodes, 0 elsewhere.

        The value networks of all seeds are evaluated, so that a seed's arithmetic does not depend on when the
        others' episodes end.
        """
        if "final_obs" not in info:
            raise ValueError(
                "an episode was cut off, and the environment's step gave no info['final_obs']: return there the last "
                "observation, as gymnasium's vector environments do with AutoresetMode.SAME_STEP"
            )
        final_obs = np.zeros((len(self.streams), self.obs_dim))
        for s in np.flatnonzero(truncated):
            final_obs[s] = np.ravel(info["final_obs"][s])
        seen = final_obs.astype(self.dtype) if self.normalizer is None else self.normalizer(final_obs)
        return np.where(truncated, self._judge(seen)[:, 0], 0)

    def _rollout(self, *arrays: NDArray[Any], episode_returns: list[list[float]]) -> Rollout:
        """Compute once, from whole arrays, what acting did not need."""
        tensors = [torch.from_numpy(array) for array in arrays]
        obs, latent, action, reward, terminated, truncated, bootstrap = tensors
        parameters, log_prob, value = self._evaluate(obs, latent)
        unit = (arrays[2] - self.policy.centre) / self.policy.half_range  # [S, T, A] executed
        return Rollout(
            obs=obs,
            latent=latent,
            action=action,
            reward=reward.to(self.networks.dtype),
            terminated=terminated,
            truncated=truncated,
            bootstrap=bootstrap,
            value=value,
            log_prob=log_prob,
            parameters=parameters,
            saturation=(np.abs(unit) >= 1 - SATURATION_MARGIN).mean((1, 2)),
            action_std=np.sqrt(np.clip(unit, -1, 1).var(1).mean(1)),
            episode_returns=episode_returns,
        )

    def _evaluate(self, obs: Tensor, latent: Tensor) -> tuple[Parameters, Tensor, Tensor]:
        """Return what `evaluate` does; under the engine `compiled`, seed by seed."""
        if self._acting is None:
            return evaluate(self.networks, obs, latent)
        alone = [
            evaluate(self.networks.seed(s), obs[s : s + 1].clone(), latent[s : s + 1].clone())
            for s in range(len(obs))
        ]
        parameters, log_prob, value = zip(*alone, strict=True)
        together = map(torch.cat, zip(*parameters, strict=True))
        return type(parameters[0])(*together), torch.cat(log_prob), torch.cat(value)

    def state_dict(self) -> dict[str, Any]:
        """Return everything that the future depends on; physics included, if the environments have `get_state`.

        A wrapper hides the state of what it wraps, since its own would be lost: it may have a `get_state` for both.
        """
        get_state = getattr(self.envs, "get_state", None)
        return {
            "envs": get_state() if get_state is not None else None,
            "box": self._box(),
            "obs": self.obs.copy(),
            "returns": self.returns.copy(),
            "normalizer": self.normalizer and self.normalizer.state_dict(),
            "noise": generator_states([stream.noise for stream in self.streams]),
        }

    def check_state_dict(self, state: dict[str, Any]) -> None:
        """Refuse a state that is not of these environments.

        Raises:
            ValueError: the environment's actions have other bounds than they had.
        """
        if "box" in state and not all(map(np.array_equal, state["box"], self._box())):
            raise ValueError(
                "the environment's action bounds are not those that the run began with: "
                "use that environment, or another run directory"
            )

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Go back to a state. Environments without `set_state` start new episodes instead, not those of the beginning.

        Raises:
            ValueError: it is not of these environments.
        """
        self.check_state_dict(state)
        set_state = getattr(self.envs, "set_state", None)  # not what a wrapper wraps: it would not know
        if goes_on := state["envs"] is not None and set_state is not None:
            set_state(state["envs"])  # before all else: it may refuse
            self.obs, self.returns[:] = state["obs"].copy(), state["returns"]
        restore_generators([stream.noise for stream in self.streams], state["noise"])
        if self.normalizer is not None:
            self.normalizer.load_state_dict(state["normalizer"])
        if not goes_on:
            # New starts, decided by the state; their observations are seen with the statistics that have been loaded.
            self.restart([int(stream.noise.integers(2**31)) for stream in self.streams])

    def _box(self) -> list[np.ndarray]:
        box: Any = self.envs.single_action_space
        return [box.low.copy(), box.high.copy()]


@torch.no_grad()
def evaluate(networks: ActorCritic, obs: Tensor, latent: Tensor) -> tuple[Parameters, Tensor, Tensor]:
    """Return the law's parameters `[S, T, A]`, the log-densities of the latents and the values, `[S, T]` each."""
    parameters = networks.parameters(obs)
    log_prob = networks.policy.law.log_prob(parameters, latent)
    return parameters, log_prob, networks.values(obs).contiguous()


def check_environments(envs: VectorEnv[Any, Any, Any], num_seeds: int, mode: ActionMode = "clip") -> None:
    """Raise unless the environments are ones a `Collector` can act in.

    Args:
        envs: the environments.
        num_seeds: how many there must be.
        mode: how the configuration treats actions beyond the box.

    Raises:
        ValueError: no vector environment, another number, another autoreset mode, observations that are no Box or are
            images, actions that `require_box` refuses, or that they clip themselves where the mode is "raw".
    """
    if not hasattr(envs, "num_envs"):
        raise ValueError(
            f"training takes a vector environment, got {envs}: let make_envs return "
            "gymnasium.vector.SyncVectorEnv([make] * n, autoreset_mode=gymnasium.vector.AutoresetMode.SAME_STEP)"
        )
    if envs.num_envs != num_seeds:
        raise ValueError(f"one environment per seed: make {num_seeds} instead of {envs.num_envs}")
    wrapped = getattr(envs, "unwrapped", envs) is not envs  # a wrapper may map actions into the box
    if mode == "raw" and not wrapped and getattr(envs, "action_mode", mode) != mode:
        raise ValueError('the configuration says action_mode="raw": make the environments with it, too')
    if (reset := envs.metadata.get("autoreset_mode")) != AutoresetMode.SAME_STEP:
        raise ValueError(
            f"the environments reset in the mode {reset}, which puts dummy transitions into the data: make them with "
            "autoreset_mode=gymnasium.vector.AutoresetMode.SAME_STEP (by gymnasium.make_vec: with "
            'vector_kwargs={"autoreset_mode": ...})'
        )
    space = envs.single_observation_space
    if not isinstance(space, gymnasium.spaces.Box) or (len(space.shape) == 3 and space.dtype == np.uint8):
        raise ValueError(
            f"observations must be a Box, and no images, got {space}: the networks are perceptrons. Flatten them "
            "(gymnasium.wrappers.FlattenObservation), or let stable-baselines3 see them (inbounds.integrations)"
        )
    require_box(envs.single_action_space)
