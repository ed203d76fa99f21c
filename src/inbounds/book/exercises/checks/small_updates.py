"""One update of small networks: by a reader's program, by the package, and with each of the known mistakes.

The graders of *PPO* and *TRPO* give a reader's ``update`` the networks and the steps of a `Small`, and compare where
the weights end.
"""

from __future__ import annotations

import dataclasses
from collections import namedtuple
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn
from torch.distributions import Normal, kl_divergence

from inbounds.learning import (
    ActorCritic,
    NetworkConfig,
    Policy,
    PolicyConfig,
    PPOConfig,
    Rollout,
    TRPOConfig,
    ppo,
    trpo,
)

__all__ = ["EDGE", "FAR", "PPO", "QUIET", "SEED", "TRPO", "Batch", "Small", "SmallPolicy", "explained"]

Batch = namedtuple("Batch", "obs latent reward terminated truncated next_obs")
"""The steps of a rollout, a column each, as the growing program keeps them."""
SEED = 8
"""Of torch's generator, which shuffles."""
OBS, ACT, STEPS = 3, 2, 64
PPO = PPOConfig(
    horizon=STEPS, minibatch_size=16, num_epochs=3, learning_rate=1e-2, entropy_coef=0.05, clip_range=0.1
)
TRPO = TRPOConfig(horizon=STEPS, minibatch_size=16, num_epochs=3, learning_rate=1e-2, entropy_coef=0.0)
FAR = dataclasses.replace(TRPO, max_kl=0.3)
"""So far that the quadratic model fails, and the line search has to shorten the step."""
EDGE = dataclasses.replace(TRPO, max_kl=1.5)
"""So far that the divergence's two directions differ: one of them allows the full step."""
QUIET = dataclasses.replace(TRPO, adam_eps=1e-2)
"""An Adam that does not forget how long a gradient is, for a `Small` of so small a unit that nothing is clipped."""


ERRORS = {
    "must match the size of tensor": "a piece meets a whole batch, or a number for each motor a number a step: take "
    "[index] of advantages, targets and old log-probabilities, and .sum(-1) in the policy's methods",
    "through the graph a second time": "what is computed once, before the first step, is a constant: .detach() the old "
    "log-probabilities, and the values in `advantages`",
    "only for scalar outputs": "one number is wanted: a .mean() is missing",
    "element 0 of tensors": "a gradient is asked of mere numbers: create_graph=True where a gradient is differentiated "
    "again, and no .detach() of anything new",
    "invalid values": "the policy's weights have become nan. In PPO a piece of a single row does that, whose standard "
    "deviation is nan: pieces have `size` rows. In TRPO a gain() of gradient 0 does: is the old log-probability a "
    "constant, .detach()?",
    "ellipsis": "a blank further up still returns ...: write it, run its cell, and this one again",
}
"""Words of an error of Python's → what it means in an update."""


def explained(error: Exception) -> str:
    """An error that a reader's update raised, with its meaning where it is a known one.

    Example:
        >>> explained(TypeError("cannot unpack non-iterable ellipsis object")).partition(". ")[2][:38]
        'A blank further up still returns ...: '
    """
    first = str(error).partition("\n")[0][:160].rstrip(".")
    raised = f"it raised {type(error).__name__}: {first}"
    meaning = next((told for words, told in ERRORS.items() if words in str(error)), "")
    return f"{raised}. {meaning[0].upper()}{meaning[1:]}" if meaning else raised


class SmallPolicy:
    """A Gaussian policy as the growing program has one."""

    def __init__(self, net: nn.Sequential) -> None:
        self.net = net

    def law(self, outputs: Tensor) -> Normal:
        """Return the law of each latent `[B, A]`, of outputs `[B, 2A]`."""
        loc, log_scale = outputs.chunk(2, -1)
        return Normal(loc, log_scale.clamp(-10, 1).exp())

    def log_prob(self, obs: Tensor, latent: Tensor) -> Tensor:
        """Return log-densities `[B]` of latents `[B, A]`."""
        return self.law(self.net(obs)).log_prob(latent).sum(-1)

    def entropy(self, obs: Tensor) -> Tensor:
        """Return entropies `[B]`, in nats."""
        return self.law(self.net(obs)).entropy().sum(-1)

    def kl(self, old_outputs: Tensor, obs: Tensor) -> Tensor:
        """Return KL(old‖new) `[B]` for old outputs `[B, 2A]`, in nats."""
        return kl_divergence(self.law(old_outputs), self.law(self.net(obs))).sum(-1)


class _Orders:
    """A generator of the package's shuffles that draws them as a reader's program does."""

    def permutation(self, length: int) -> np.ndarray:
        return torch.randperm(length).numpy()


class Small:
    """Networks of one seed, and steps that their policy drew.

    Args:
        unit: of rewards and values. With 1 every gradient of the critic's is clipped, with 0.01 none.
        log_scale: added to log σ. Far below 0 the curvature is large beside TRPO's damping.

    Example:
        >>> small = Small()
        >>> before = small.weights()
        >>> moved = small.after_the_packages(TRPO)
        >>> before.shape == moved.shape, bool((before == moved).all())
        (True, False)
    """

    def __init__(self, unit: float = 1.0, log_scale: float = 0.0) -> None:
        self.unit, self.log_scale = unit, log_scale
        policy = Policy(PolicyConfig("gaussian"), -np.ones(ACT), np.ones(ACT))
        network = NetworkConfig(hidden_sizes=(8, 8), dtype="float64", policy_head_gain=0.5)
        self.networks = ActorCritic(policy, OBS, network, [torch.Generator().manual_seed(3)])
        with torch.no_grad():
            self.networks.critic.layers[-1].weight.mul_(unit)
            self.networks.critic.layers[-1].bias.mul_(unit)
            self.networks.actor.layers[-1].bias[:, ACT:] += log_scale
        actor, critic = map(_plain, self.networks.networks)
        self.policy, self.critic = SmallPolicy(actor), nn.Sequential(critic, nn.Flatten(0))
        self.actor_size = sum(p.numel() for p in actor.parameters())
        self.batch = self._steps()

    def _steps(self) -> Batch:
        generator = torch.Generator().manual_seed(9)
        obs, next_obs = torch.randn(2, STEPS, OBS, generator=generator, dtype=torch.float64)
        noise = torch.randn(STEPS, ACT, generator=generator, dtype=torch.float64)
        reward = self.unit * (2 * torch.randn(STEPS, generator=generator, dtype=torch.float64) + 1)
        ends = torch.zeros(2, STEPS, dtype=torch.float64)
        ends[0, [10, 40]], ends[1, [25]] = 1.0, 1.0
        next_obs[:-1] = torch.where(ends.sum(0)[:-1, None] > 0, next_obs[:-1], obs[1:])
        with torch.no_grad():
            loc, log_scale = self.policy.net(obs).chunk(2, -1)
        latent = loc + log_scale.exp() * noise
        return Batch(obs, latent, reward, ends[0], ends[1], next_obs)

    def adam(self, config: PPOConfig | TRPOConfig) -> torch.optim.Adam:
        """Return one Adam over both networks."""
        weights = [*self.policy.net.parameters(), *self.critic.parameters()]
        return torch.optim.Adam(weights, config.learning_rate, eps=config.adam_eps)

    def weights(self) -> Tensor:
        """Return all weights `[P]`: the policy's, then the critic's."""
        networks = self.policy.net, self.critic
        return torch.cat([p.detach().flatten().clone() for net in networks for p in net.parameters()])

    def rollout(self) -> Rollout:
        """Return the steps as the package keeps them."""
        obs, latent, reward, terminated, truncated, next_obs = (column[None] for column in self.batch)
        cut = truncated.bool()
        cut[:, -1] |= ~terminated[:, -1].bool()
        with torch.no_grad():
            parameters = self.networks.parameters(obs)
            value, after = self.networks.values(obs), self.networks.values(next_obs)
            log_prob = self.networks.policy.law.log_prob(parameters, latent)
        return Rollout(
            obs=obs,
            latent=latent,
            action=latent,
            reward=reward,
            terminated=terminated.bool(),
            truncated=truncated.bool(),
            bootstrap=torch.where(cut, after, 0.0),
            value=value,
            log_prob=log_prob,
            parameters=parameters,
            saturation=np.zeros(1),
            action_std=np.ones(1),
            episode_returns=[[]],
        )

    def after_the_packages(self, config: PPOConfig | TRPOConfig) -> Tensor:
        """Return the weights `[P]` after the package's update, of PPO or of TRPO; these networks stay as they are."""
        algorithm: Any = ppo if isinstance(config, PPOConfig) else trpo
        networks, rollout = Small(self.unit, self.log_scale).networks, self.rollout()
        torch.manual_seed(SEED)
        algorithm.update(networks, algorithm.make_optimizer(networks, config), rollout, [_Orders()], config)
        return torch.cat([p.detach().flatten() for net in networks.networks for p in net.parameters])

    def after_a_flawed(self, flaw: str) -> Tensor:
        """Return the weights `[P]` after PPO's update with one mistake; the networks are moved.

        Args:
            flaw: a value of `inbounds.book.exercises.ppo.MISTAKES`; "" is none, and so is "on and on", which shuffles
                in each pass the rows as the last pass left them.
        """
        advantage, to_go = self._advantages()
        clip_range = 0.2 if flaw in ("clip range", "no coefficients") else PPO.clip_range
        bonus = {"no bonus": 0.0, "no coefficients": 1e-4}.get(flaw, PPO.entropy_coef)
        old, adam = self.policy.log_prob(self.batch.obs, self.batch.latent).detach(), self.adam(PPO)
        if flaw == "whole":
            advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
        torch.manual_seed(SEED)
        order = torch.arange(STEPS) if flaw == "unshuffled" else torch.randperm(STEPS)
        if flaw == "swapped":
            advantage, to_go = to_go, advantage
        for number in range(1 if flaw == "one pass" else 3):
            if flaw == "density of each pass":
                old = self.policy.log_prob(self.batch.obs, self.batch.latent).detach()
            if flaw == "each pass":
                advantage, to_go = self._advantages()
            if number and flaw not in ("one order", "unshuffled"):
                order = order[torch.randperm(STEPS)] if flaw == "on and on" else torch.randperm(STEPS)
            for piece in order.split(16):
                if flaw == "each step":
                    advantage, to_go = self._advantages()
                index = slice(None) if flaw == "no pieces" else piece
                target = _normalized(to_go[index]) if flaw == "targets" else to_go[index]
                obs, latent, a = self.batch.obs[index], self.batch.latent[index], advantage[index]
                if flaw not in ("raw", "whole"):
                    a = _normalized(a, flaw)
                log_prob = self.policy.log_prob(obs, latent)
                ratio = (log_prob - (log_prob.detach() if flaw == "own density" else old[index])).exp()
                gain = torch.minimum(ratio * a, a + clip_range * a.abs()).mean()
                error = (1.0 if flaw == "value coef" else 0.5) * (self.critic(obs) - target).square().mean()
                if flaw != "accumulate":
                    adam.zero_grad()
                loss = error - gain - bonus * self.policy.entropy(obs).mean()
                (-loss if flaw == "uphill" else loss).backward()
                self._clip(flaw)
                adam.step()
        return self.weights()

    def critic_after_a_flawed(self, flaw: str, config: TRPOConfig) -> Tensor:
        """Return the critic's weights `[P]` after TRPO's regression with one mistake; the critic is moved.

        Args:
            flaw: a value of `inbounds.book.exercises.checks.trpo_updates.MISTAKES`; "" is none.
            config: of the step.
        """
        target, adam = self._advantages()[flaw != "advantages"], self.adam(config)
        target = _normalized(target) if flaw == "targets" else target
        torch.manual_seed(SEED)
        order = torch.arange(STEPS) if flaw == "unshuffled" else torch.randperm(STEPS)
        for number in range(1 if flaw == "one pass" else 3):
            if number and flaw not in ("one order", "unshuffled"):
                order = torch.randperm(STEPS)
            target = self._advantages()[1] if flaw == "each pass" else target
            for piece in order.split(16):
                index = slice(None) if flaw == "no pieces" else piece
                value = self.critic((self.batch.next_obs if flaw == "next" else self.batch.obs)[index])
                error = (value[:, None] if flaw == "broadcast" else value) - target[index]
                square = error.abs() if flaw == "absolute" else error.square()
                loss = {"sum": square.sum(), "half": square.mean() / 2, "twice": 2 * square.mean()}
                adam.zero_grad()
                loss.get(flaw, square.mean()).backward()
                self._clip("free" if flaw == "free" else "")
                adam.step()
        return torch.cat([p.detach().flatten() for p in self.critic.parameters()])

    def _advantages(self) -> tuple[Tensor, Tensor]:
        """GAE and its targets `[T]`, with the critic as it is."""
        batch = self.batch
        with torch.no_grad():
            value, after = self.critic(batch.obs), self.critic(batch.next_obs)
        ends = batch.terminated
        residual = batch.reward + PPO.gamma * torch.where(ends > 0, 0.0, after) - value
        found, later = torch.zeros_like(value), 0.0
        for t in range(STEPS - 1, -1, -1):
            later = 0.0 if ends[t] + batch.truncated[t] > 0 else later
            found[t] = later = residual[t] + PPO.gamma * PPO.gae_lambda * later
        return found, found + value

    def _clip(self, flaw: str) -> None:
        both = [*self.policy.net.parameters()], [*self.critic.parameters()]
        for weights in both if flaw == "apart" else () if flaw == "free" else ([*both[0], *both[1]],):
            nn.utils.clip_grad_norm_(weights, 0.5)


def _normalized(x: Tensor, flaw: str = "") -> Tensor:
    spread, centred = x.std(correction=0 if flaw == "population" else 1) + 1e-8, x - x.mean()
    wrong = {
        "bracket": x - x.mean() / spread,
        "centred": centred,
        "scaled": x / spread,
        "variance": centred / x.var(),
    }
    return wrong.get(flaw, centred / spread)


def _plain(net: Any) -> nn.Sequential:
    """The one seed of an `Mlp` as torch's own layers."""
    layers: list[nn.Module] = []
    for layer in net.layers:
        size_out, size_in = layer.weight.shape[1:]
        linear = nn.Linear(size_in, size_out).double()
        linear.weight.data.copy_(layer.weight[0])
        linear.bias.data.copy_(layer.bias[0, :, 0])
        layers += [linear, nn.Tanh()]
    return nn.Sequential(*layers[:-1])
