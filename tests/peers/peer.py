"""Putting the same weights and the same rollout into stable-baselines3's networks and buffers.

Nothing of the peer's arithmetic is touched. What is adapted is where it would round to float32:

* its networks are cast to float64, and its `preprocess_obs`, which casts observations, is replaced (`conftest.py`);
* its rollout buffer allocates float32 arrays and casts actions to float32: a subclass does neither;
* both sides draw minibatches by `numpy.random.RandomState(seed).permutation`, the peer from NumPy's global one.
"""

from typing import Any

import gymnasium
import numpy as np
import pytest
import torch

from inbounds.learning import ActorCritic, Rollout, TrainConfig, Trainer
from inbounds.robots.vector_env import RobotVectorEnv

WHY = "stable-baselines3 and sb3-contrib are needed: pip install -e '.[bench]'"
pytest.importorskip("stable_baselines3", reason=WHY)
pytest.importorskip("sb3_contrib", reason=WHY)

from stable_baselines3.common.buffers import RolloutBuffer  # noqa: E402
from stable_baselines3.common.logger import configure  # noqa: E402
from stable_baselines3.common.on_policy_algorithm import OnPolicyAlgorithm  # noqa: E402
from stable_baselines3.common.type_aliases import RolloutBufferSamples  # noqa: E402

ENV = "Hopper-v5"  # its box is [−1, 1]: unit actions and actions are the same numbers
ACT_DIM = 3
TASK_LENGTH = 9  # steps until truncation; the untrained Hopper falls after about twenty


class Float64RolloutBuffer(RolloutBuffer):
    """The peer's buffer without its float32."""

    def reset(self) -> None:
        super().reset()
        for name in ("actions", "rewards", "returns", "episode_starts", "values", "log_probs", "advantages"):
            setattr(self, name, getattr(self, name).astype(np.float64))

    def _get_samples(self, batch_inds: np.ndarray, env: Any = None) -> RolloutBufferSamples:
        scalars = [
            getattr(self, n)[batch_inds].ravel() for n in ("values", "log_probs", "advantages", "returns")
        ]
        arrays = self.observations[batch_inds], self.actions[batch_inds], *scalars
        return RolloutBufferSamples(*map(torch.as_tensor, arrays))


def our_side(config: TrainConfig) -> tuple[Trainer, Rollout]:
    """Return a fresh run and its first rollout, which holds both falls and truncations."""
    trainer = Trainer(config, lambda n: RobotVectorEnv(ENV, n, max_episode_steps=TASK_LENGTH))
    with torch.no_grad():  # far enough from the small first head that every weight matters
        for layer in trainer.networks.actor.layers:
            layer.weight *= 2
            layer.bias += 0.1
        trainer.networks.actor.layers[-1].bias[:, trainer.networks.policy.act_dim :] = -0.7  # log σ
    rollout = trainer.collector.collect(config.algorithm.horizon)
    assert rollout.truncated.any()
    assert rollout.terminated.any()
    return trainer, rollout


def their_side(
    kind: type[OnPolicyAlgorithm], config: TrainConfig, env: gymnasium.Env | None = None, **settings: Any
) -> Any:
    """Return the peer's algorithm in float64, with the numbers that both sides call the same."""
    algorithm = config.algorithm
    peer: Any = kind(
        "MlpPolicy",
        env or gymnasium.make(ENV),
        n_steps=algorithm.horizon,
        batch_size=algorithm.minibatch_size,
        gamma=algorithm.gamma,
        gae_lambda=algorithm.gae_lambda,
        learning_rate=algorithm.learning_rate,
        normalize_advantage=algorithm.normalize_advantage,
        policy_kwargs={"optimizer_kwargs": {"eps": algorithm.adam_eps}},
        rollout_buffer_class=Float64RolloutBuffer,
        device="cpu",
        **settings,
    )
    peer.policy.double()
    peer.set_logger(configure(format_strings=[]))
    return peer


def ppo_settings(algorithm: Any) -> dict[str, Any]:
    """Return what only PPO has, under the peer's names."""
    return {
        "n_epochs": algorithm.num_epochs,
        "clip_range": algorithm.clip_range,
        "ent_coef": algorithm.entropy_coef,
        "vf_coef": algorithm.value_coef,
        "max_grad_norm": algorithm.max_grad_norm,
    }


def trpo_settings(algorithm: Any) -> dict[str, Any]:
    """Return what only TRPO has, under the peer's names. Its KL is the mean over action dimensions."""
    return {
        "n_critic_updates": algorithm.num_epochs,
        "target_kl": algorithm.max_kl / ACT_DIM,
        "cg_damping": algorithm.damping / ACT_DIM,
        "cg_max_steps": algorithm.cg_iters,
        "line_search_shrinking_factor": algorithm.backtrack_coef,
        "line_search_max_iter": algorithm.max_backtracks,
    }


def shuffler(seed: int) -> np.random.RandomState:
    """Return a generator of permutations, drawn as the peer draws them from NumPy's global generator."""
    return np.random.RandomState(100 + seed)


def our_weights(networks: ActorCritic, seed: int) -> dict[str, torch.Tensor]:
    """Return copies of one seed's weights under the peer's names.

    With a state-independent σ the head's last rows are zero and their biases are the free log σ.
    """
    act_dim = networks.policy.act_dim
    weights = {}
    for net, trunk in ((networks.actor, "policy"), (networks.critic, "value")):
        head = "action_net" if trunk == "policy" else "value_net"
        for layer, name in zip(net.layers, (f"{trunk}_net.0", f"{trunk}_net.2", head), strict=True):
            prefix = name if name == head else f"mlp_extractor.{name}"
            weights[f"{prefix}.weight"] = layer.weight[seed].detach().clone()
            weights[f"{prefix}.bias"] = layer.bias[seed, :, 0].detach().clone()
    assert not weights["action_net.weight"][act_dim:].any()
    weights["log_std"] = weights["action_net.bias"][act_dim:]
    weights["action_net.weight"] = weights["action_net.weight"][:act_dim]
    weights["action_net.bias"] = weights["action_net.bias"][:act_dim]
    return weights


def hand_over(peer: Any, networks: ActorCritic, rollout: Rollout, seed: int) -> None:
    """Give the peer one seed's weights and rollout, and let it compute values' targets by itself.

    As in its `collect_rollouts`, the discounted value of the last observation is added to the reward of a
    truncated step that did not also terminate, and both kinds of end count as done.
    """
    peer.policy.load_state_dict(our_weights(networks, seed))
    over = (rollout.terminated | rollout.truncated)[seed].numpy()
    cut_off = rollout.truncated & ~rollout.terminated  # its "TimeLimit.truncated"
    tail = torch.where(cut_off, rollout.bootstrap, 0)[seed].numpy()
    buffer = peer.rollout_buffer
    buffer.reset()
    buffer.observations = rollout.obs[seed].numpy()[:, None]
    buffer.actions = rollout.latent[seed].numpy()[:, None]
    buffer.rewards = (rollout.reward[seed].numpy() + peer.gamma * tail)[:, None]
    buffer.values = rollout.value[seed].numpy()[:, None]
    buffer.log_probs = rollout.log_prob[seed].numpy()[:, None]
    buffer.episode_starts = np.concatenate([[True], over[:-1]]).astype(np.float64)[:, None]
    buffer.pos, buffer.full = buffer.buffer_size, True
    buffer.compute_returns_and_advantage(rollout.bootstrap[seed, -1:], over[-1:])


def largest_difference(ours: dict[str, torch.Tensor], peer: Any) -> float:
    """Return the largest absolute difference between any two corresponding weights."""
    theirs = peer.policy.state_dict()
    assert theirs.keys() == ours.keys()
    return max((ours[name] - theirs[name]).abs().max().item() for name in ours)
