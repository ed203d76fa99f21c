"""One update of the book's own PPO and TRPO is the peers': same weights, same rollout, same order of rows.

The programs are assembled from the chapters' cells, and know nothing of the package. What is adapted is what the
programs fix and the peers fix otherwise:

* a Gaussian with σ of the state: the peer's is free, so the program's network gets a head whose log σ is a parameter;
* rows are shuffled by `torch.randperm`: it is made to draw as the peer does, from NumPy's global generator;
* TRPO's sum over action dimensions, and the peer's mean over them, as in `test_trpo_step.py`.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from torch import nn

from inbounds.book.pages import programs
from inbounds.learning import ActorCritic, Rollout
from tests.book import by_hand
from tests.peers.peer import hand_over, largest_difference, our_side, our_weights, shuffler, their_side
from tests.peers.test_ppo_update import config as ppo_config  # noqa: F401  (a fixture)
from tests.peers.test_trpo_step import ACT_DIM, make_config, no_noise  # noqa: F401  (a fixture)

NOTEBOOKS = Path(__file__).resolve().parents[2] / "notebooks"
SEED = 0


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


def the_program(name: str, networks: ActorCritic) -> tuple[dict[str, Any], Any, nn.Sequential]:
    """A chapter's program, its Gaussian policy and its critic, with the weights that the peer is given."""
    program, weights = by_hand.run(programs.assemble(NOTEBOOKS / f"{name}.ipynb")), our_weights(networks, SEED)
    policy = object.__new__(program["Policy"])
    policy.law, policy.squeeze = program["POLICIES"]["gaussian"]
    policy.net = FreeScale(weights)
    return program, policy, nn.Sequential(stacked(weights, "value", "value_net"), nn.Flatten(0))


def the_batch(program: dict[str, Any], rollout: Rollout) -> Any:
    """The rollout as the program keeps one; next_obs of an end are never looked at, and those of a cut are worth V."""
    obs = rollout.obs[SEED]
    columns = rollout.latent, rollout.reward, rollout.terminated, rollout.truncated
    return program["Batch"](obs, *(column[SEED].double() for column in columns), obs.roll(-1, 0))


def weights_of(policy: Any, critic: nn.Sequential) -> dict[str, torch.Tensor]:
    """The program's weights under the peer's names."""
    found = {"log_std": policy.net.log_std.detach()}
    for layers, trunk, head in ((policy.net.layers, "policy", "action_net"), (critic[0], "value", "value_net")):
        names = (f"mlp_extractor.{trunk}_net.0", f"mlp_extractor.{trunk}_net.2", head)
        for name, layer in zip(names, layers[::2], strict=True):
            found[f"{name}.weight"], found[f"{name}.bias"] = layer.weight.detach(), layer.bias.detach()
    return found
