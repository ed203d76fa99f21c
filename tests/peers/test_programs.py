"""One update of the book's own PPO and TRPO is the peers': same weights, same rollout, same order of rows.

The programs are assembled from the chapters' cells, and know nothing of the package. What is adapted is what the
programs fix and the peers fix otherwise:

* a Gaussian with σ of the state: the peer's σ is free, so the policy's network ends in a log σ that is a parameter;
* rows are shuffled by `torch.randperm`: it is made to draw as the peer does, from NumPy's global generator;
* TRPO's sum over action dimensions, and the peer's mean over them, as in `test_trpo_step.py`.
"""

import dataclasses
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import torch
from torch import nn

from inbounds.book.pages import programs
from inbounds.learning import ActorCritic, TrainConfig
from tests.book import by_hand
from tests.book.test_program_in_sixty_lines import as_rollout
from tests.peers import test_ppo_update, test_trpo_step
from tests.peers.peer import (
    ENV,
    hand_over,
    largest_difference,
    our_side,
    our_weights,
    ppo_settings,
    shuffler,
    their_side,
    trpo_settings,
)

NOTEBOOKS = Path(__file__).resolve().parents[2] / "notebooks"
SEED, ONLY = 1, 0  # of the run, and its place among the runs in lockstep
LENGTH = 25  # steps until truncation: some episodes end with a fall before, some do not
config = test_ppo_update.config
no_noise = test_trpo_step.no_noise


class FreeScale(nn.Module):
    """The peer's actor: the mean from layers, log σ a parameter of its own; outputs `[B, 2A]`."""

    def __init__(self, weights: dict[str, torch.Tensor]) -> None:
        super().__init__()
        self.log_std = nn.Parameter(weights["log_std"].clone())
        self.layers = stacked(weights, "policy", "action_net")

    def forward(self, obs: torch.Tensor) -> torch.Tensor:
        loc = self.layers(obs)
        return torch.cat([loc, self.log_std.expand_as(loc)], -1)


def stacked(weights: dict[str, torch.Tensor], trunk: str, head: str) -> nn.Sequential:
    """Torch's own layers with weights under the peer's names."""
    layers: list[nn.Module] = []
    for name in (f"mlp_extractor.{trunk}_net.0", f"mlp_extractor.{trunk}_net.2", head):
        size_out, size_in = weights[f"{name}.weight"].shape
        linear = nn.Linear(size_in, size_out).double()
        linear.weight.data.copy_(weights[f"{name}.weight"])
        linear.bias.data.copy_(weights[f"{name}.bias"])
        layers += [linear, nn.Tanh()]
    return nn.Sequential(*layers[:-1])


def started(name: str, config: TrainConfig) -> tuple[dict[str, Any], Any, nn.Sequential, Any, ActorCritic]:
    """A chapter's program, its Gaussian policy, its critic and its batch, and the package's networks alike."""
    networks = our_side(dataclasses.replace(config, seeds=(SEED,)))[0].networks
    for net in networks.networks:  # the program collects in float32: no weight is to be rounded there
        net.theta.data.copy_(net.theta.data.float().double())
    program, weights = (
        by_hand.run(programs.assemble(NOTEBOOKS / f"{name}.ipynb")),
        our_weights(networks, ONLY),
    )
    env = gym.make(ENV, max_episode_steps=LENGTH)
    policy = program["Policy"](
        env.observation_space.shape[0], env.action_space, *program["POLICIES"]["gaussian"]
    )
    policy.net = FreeScale(weights).float()
    torch.manual_seed(SEED)
    _, batch = program["collect"](env, env.reset(seed=SEED)[0], policy, config.algorithm.horizon)
    env.close()
    assert batch.terminated.any()
    assert batch.truncated.any()
    policy.net.double()
    critic = nn.Sequential(stacked(weights, "value", "value_net"), nn.Flatten(0))
    return program, policy, critic, program["Batch"](*(column.double() for column in batch)), networks


def updated(
    parts: tuple[dict[str, Any], Any, nn.Sequential, Any, ActorCritic],
    config: TrainConfig,
    orders: np.random.RandomState,
    monkeypatch: pytest.MonkeyPatch,
    **numbers: float,
) -> dict[str, torch.Tensor]:
    """The weights after the program's update, under the peer's names."""
    program, policy, critic, batch, _ = parts
    monkeypatch.setattr(torch, "randperm", lambda length: torch.from_numpy(orders.permutation(length)))
    weights, algorithm = [*policy.net.parameters(), *critic.parameters()], config.algorithm
    adam = torch.optim.Adam(weights, algorithm.learning_rate, eps=algorithm.adam_eps)
    passes, size = algorithm.num_epochs, algorithm.minibatch_size
    program["update"](policy, critic, adam, batch, passes=passes, size=size, **numbers)
    return weights_of(policy, critic)


def weights_of(policy: Any, critic: nn.Sequential) -> dict[str, torch.Tensor]:
    """The program's weights under the peer's names."""
    found = {"log_std": policy.net.log_std.detach()}
    for layers, trunk, head in (
        (policy.net.layers, "policy", "action_net"),
        (critic[0], "value", "value_net"),
    ):
        names = (f"mlp_extractor.{trunk}_net.0", f"mlp_extractor.{trunk}_net.2", head)
        for name, layer in zip(names, layers[::2], strict=True):
            found[f"{name}.weight"], found[f"{name}.bias"] = layer.weight.detach(), layer.bias.detach()
    return found


def furthest(ours: dict[str, torch.Tensor], before: dict[str, torch.Tensor]) -> float:
    """The largest change of a weight."""
    return max((ours[name] - before[name]).abs().max().item() for name in ours)


def test_ppo_s_update_is_the_peer_s(config: TrainConfig, monkeypatch: pytest.MonkeyPatch) -> None:
    from stable_baselines3 import PPO

    parts, algorithm = started("ppo", config), config.algorithm
    assert (algorithm.gamma, algorithm.gae_lambda, algorithm.max_grad_norm) == (0.99, 0.95, 0.5)
    peer = their_side(
        PPO,
        config,
        **ppo_settings(algorithm),
    )
    before = our_weights(parts[4], ONLY)
    hand_over(peer, parts[4], as_rollout(parts[4], parts[3]), ONLY)
    np.random.set_state(shuffler(SEED).get_state())  # noqa: NPY002
    peer.train()
    numbers = {key: getattr(algorithm, key) for key in ("clip_range", "entropy_coef", "value_coef")}
    after = updated(parts, config, shuffler(SEED), monkeypatch, **numbers)
    assert furthest(after, before) > 0.02
    assert largest_difference(after, peer) < 1e-9


@pytest.mark.usefixtures("no_noise")
def test_trpo_s_update_is_the_peer_s(monkeypatch: pytest.MonkeyPatch) -> None:
    """Policy step and value regression; the peer clips no gradient, so the program's step is told not to."""
    from sb3_contrib import TRPO

    config = test_trpo_step.make_config(backtrack_coef=0.5)
    parts, algorithm = started("trpo", config), config.algorithm
    parts[0]["step"].__defaults__ = (float("inf"),)
    assert (algorithm.cg_iters, algorithm.max_backtracks, algorithm.damping) == (10, 10, 0.1)
    peer = their_side(
        TRPO,
        config,
        **trpo_settings(algorithm),
    )
    before = our_weights(parts[4], ONLY)
    hand_over(peer, parts[4], as_rollout(parts[4], parts[3]), ONLY)
    orders = shuffler(SEED)
    np.random.set_state(orders.get_state())  # noqa: NPY002
    peer.train()
    orders.permutation(algorithm.horizon)  # the peer shuffles the whole batch, too, before the policy's step
    after = updated(parts, config, orders, monkeypatch, max_kl=algorithm.max_kl)
    assert furthest(after, before) > 0.02
    assert largest_difference(after, peer) < 1e-9
