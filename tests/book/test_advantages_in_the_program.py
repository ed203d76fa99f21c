"""Chapters 9 and 10: the program's advantages, surrogate and update, held against the package in float64."""

from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import torch

from inbounds.book.pages.programs import assemble
from inbounds.learning import FAMILIES, Limits, PolicyGradientConfig, policy_gradient, ppo
from inbounds.learning.families.policy import Policy, PolicyConfig
from inbounds.learning.networks import ActorCritic, NetworkConfig
from tests.book import by_hand
from tests.book.test_program_in_sixty_lines import as_rollout, packed

NOTEBOOKS = Path(__file__).resolve().parents[2] / "notebooks"


def started(chapter: str, family: str = "logit-normal") -> tuple[dict[str, Any], Any, Any, Any, Any]:
    """A program, and a policy, a critic and a batch of it in float64; one cut falls in the middle of the batch."""
    program = by_hand.run(assemble(NOTEBOOKS / f"{chapter}.ipynb"))
    torch.manual_seed(3)
    env = gym.make("InvertedPendulum-v5")
    obs = env.reset(seed=3)[0]
    policy = program["Policy"](len(obs), env.action_space, *program["POLICIES"][family])
    critic = torch.nn.Sequential(program["network"](len(obs), 1, 1.0), torch.nn.Flatten(0))
    _, batch = program["collect"](env, obs, policy, horizon=256)
    truncated = batch.truncated.clone()
    truncated[100] = 1 - batch.terminated[100]
    batch = program["Batch"](*(c.double() for c in batch._replace(truncated=truncated)))
    policy.net.double(), critic.double()
    return program, policy, critic, batch, env.action_space


@pytest.mark.parametrize("family", ["logit-normal", "gaussian"])
def test_an_update_with_gae_agrees_with_the_package(family: str) -> None:
    program, policy, critic, batch, box = started("advantages_of_actions", family)
    bound = Policy(PolicyConfig(family), box.low, box.high)
    networks = ActorCritic(bound, batch.obs.shape[1], NetworkConfig(dtype="float64"), [torch.Generator()])
    packed(networks, policy, critic)
    rollout = as_rollout(networks, batch)
    settings = PolicyGradientConfig(
        horizon=256, policy_learning_rate=0.01, learning_rate=0.01, adam_eps=1e-8, num_epochs=20, gae_lambda=0.95,
        minibatch_size=256, entropy_coef=0.0, max_grad_norm=None,
    )  # fmt: skip
    ours = program["advantages"](batch, critic)
    for mine, its in zip(ours, rollout.advantages(0.99, 0.95), strict=True):
        torch.testing.assert_close(mine, its[0])

    optimizer = policy_gradient.make_optimizer(networks, settings)
    policy_gradient.update(networks, optimizer, rollout, [np.random.default_rng(0)], settings)
    adams = [torch.optim.Adam(net.parameters(), lr=0.01) for net in (policy.net, critic)]
    program["update"](policy, critic, adams, batch)
    for net, theirs in ((policy.net, networks.actor), (critic, networks.critic)):
        flat = torch.cat([p.detach().flatten() for p in net.parameters()])
        torch.testing.assert_close(flat, theirs.theta[0].detach(), rtol=1e-5, atol=1e-8)


def test_surrogate_and_divergence_are_the_package_s() -> None:
    program, policy, critic, batch, _ = started("many_steps_from_one_batch")
    outputs, first = policy.net(batch.obs).detach(), policy.log_prob(batch.obs, batch.latent).detach()
    advantage = program["advantages"](batch, critic)[0]
    with torch.no_grad():
        for weights in policy.net.parameters():
            weights.add_(0.05 * torch.randn_like(weights))
    now = policy.log_prob(batch.obs, batch.latent)
    theirs = ppo.clipped_surrogate(now, first, advantage, clip_range=1e9).mean()
    torch.testing.assert_close(program["surrogate"](policy, batch, advantage, first), theirs)
    law = FAMILIES["logit-normal"].law
    pair = [law.parameters(x, Limits()) for x in (outputs, policy.net(batch.obs))]
    torch.testing.assert_close(policy.kl(outputs, batch.obs), law.kl(*pair))
    assert policy.kl(outputs, batch.obs).mean() > 1e-3


def test_an_update_stops_where_the_divergence_passes_the_limit() -> None:
    divergences = {}
    for limit in (1e-9, 0.05, np.inf):
        program, policy, critic, batch, _ = started("many_steps_from_one_batch")
        outputs = policy.net(batch.obs).detach()
        adams = [torch.optim.Adam(net.parameters(), lr=0.003) for net in (policy.net, critic)]
        program["update"](policy, critic, adams, batch, target_kl=limit)
        taken = next(iter(adams[0].state.values()))["step"].item()
        divergences[limit] = taken, policy.kl(outputs, batch.obs).mean().item()
    assert divergences[1e-9][0] == 1
    assert divergences[np.inf][0] == 10
    assert 1 < divergences[0.05][0] < 10
    assert divergences[0.05][1] > 0.05
    assert divergences[np.inf][1] > divergences[0.05][1]


def test_the_first_step_is_that_of_the_chapter_before() -> None:
    moved = []
    for chapter, more in (("advantages_of_actions", {}), ("many_steps_from_one_batch", {"steps": 1})):
        program, policy, critic, batch, _ = started(chapter)
        adams = [torch.optim.Adam(net.parameters(), lr=0.01) for net in (policy.net, critic)]
        program["update"](policy, critic, adams, batch, **more)
        moved.append(torch.cat([p.detach().flatten() for p in policy.net.parameters()]))
    torch.testing.assert_close(*moved, rtol=1e-9, atol=1e-12)
