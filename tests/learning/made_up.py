"""Rollouts of any shape, made up: what a gradient step takes, without an environment."""

from typing import Any

import numpy as np
import torch

from inbounds.learning import ActorCritic, NetworkConfig, Policy, PolicyConfig, Rollout

SHAPES = {"Swimmer": (8, 2), "HalfCheetah": (17, 6), "Humanoid": (348, 17)}
"""Numbers of observations and actions."""


def made_up_networks(
    family: str, shape: tuple[int, int], dtype: str, hidden: tuple[int, ...] = (64, 64), **policy: Any
) -> ActorCritic:
    """One seed's, with outputs far from zero: some of them beyond the limits of their law."""
    obs_dim, act_dim = shape
    bound = Policy(PolicyConfig(family, **policy), -np.ones(act_dim), np.ones(act_dim))
    config = NetworkConfig(hidden, policy_head_gain=1.5, dtype=dtype)
    networks = ActorCritic(bound, obs_dim, config, [torch.Generator().manual_seed(7)])
    generator = torch.Generator().manual_seed(8)
    with torch.no_grad():
        for network in networks.networks:
            for layer in network.layers:
                layer.bias.add_(
                    0.3 * torch.randn(layer.bias.shape, generator=generator, dtype=networks.dtype)
                )
    return networks


def made_up_rollout(networks: ActorCritic, steps: int, spread: float = 0.3) -> Rollout:
    """Steps whose log-ratios are spread about zero, with latents that the law has drawn."""
    rng = np.random.default_rng(3)
    obs_dim, act_dim = networks.actor.sizes[0], networks.policy.act_dim
    obs = torch.from_numpy(rng.normal(0, 1, (1, steps, obs_dim))).to(networks.dtype)
    with torch.no_grad():
        parameters = networks.parameters(obs)
        sampler = networks.policy.law.sampler([rng] * steps, 1, act_dim, obs.numpy().dtype)
        latent = torch.from_numpy(sampler(parameters.each(lambda x: x[0].numpy()), 0))[None].to(obs.dtype)
        log_prob = networks.policy.law.log_prob(parameters, latent)
        value = networks.values(obs).contiguous()
    noise, reward = (torch.from_numpy(rng.normal(0, s, (1, steps))).to(obs.dtype) for s in (spread, 1))
    never = torch.zeros(1, steps, dtype=torch.bool)
    return Rollout(
        obs=obs,
        latent=latent,
        action=latent,
        reward=reward,
        terminated=never,
        truncated=never,
        bootstrap=value,
        value=value,
        log_prob=log_prob + noise,
        parameters=parameters,
        saturation=np.zeros(1),
        action_std=np.zeros(1),
        episode_returns=[[]],
    )
