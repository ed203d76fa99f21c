"""What PPO's loss must do, as named checks: each looks at one thing, and says in words what is wrong with it.

They see a loss from outside, as a function of two networks and a minibatch, by its value and its gradients:
`inbounds.book.exercises.ppo` runs them on what readers write, in the order of `CHECKS`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TypeAlias

import torch
from torch import Tensor, nn
from torch.distributions import Normal

from inbounds.book.exercises.checks.small_updates import Batch
from inbounds.learning.families import NORMAL, Limits
from inbounds.learning.families.gaussian import normal_entropy

__all__ = ["CHECKS", "Loss", "Scene", "ScenePolicy", "policy_loss"]

OBS, ACT, STEPS = 3, 2, 64
EPSILON = 0.2

Loss: TypeAlias = Callable[..., Tensor]
"""``loss(policy, critic, batch, advantage, to_go, old_log_prob, clip_range, entropy_coef, value_coef)``."""
Check: TypeAlias = Callable[[Loss], "str | None"]
"""Returns what is wrong, or None."""


@dataclasses.dataclass
class ScenePolicy:
    """A Gaussian policy as the growing program has one, its density and entropy being the package's."""

    net: nn.Sequential
    """Observations `[B, O]` to outputs `[B, 2A]`."""

    def law(self, outputs: Tensor) -> Normal:
        """Return the law of each latent `[B, A]`, of outputs `[B, 2A]`."""
        parameters = NORMAL.parameters(outputs, Limits())
        return Normal(parameters.loc, parameters.log_scale.exp())

    def log_prob(self, obs: Tensor, latent: Tensor) -> Tensor:
        """Return log-densities `[B]` of latents `[B, A]`."""
        return NORMAL.log_prob(NORMAL.parameters(self.net(obs), Limits()), latent)

    def entropy(self, obs: Tensor) -> Tensor:
        """Return entropies `[B]`, in nats."""
        return normal_entropy(NORMAL.parameters(self.net(obs), Limits()))


@dataclasses.dataclass
class Scene:
    """Two small networks, and steps that the policy drew."""

    policy: ScenePolicy
    critic: nn.Sequential
    """Observations `[B, O]` to values `[B]`."""
    batch: Batch
    """`obs`, `next_obs` `[B, O]` and `latent` `[B, A]`; no loss looks at the other columns."""
    advantage: Tensor
    to_go: Tensor
    old_log_prob: Tensor

    @classmethod
    def of(cls, seed: int) -> Scene:
        """Return a scene of its own for each seed, in float64; σ is about 1.3, so that many latents leave [−1, 1]."""
        generator = torch.Generator().manual_seed(seed)

        def randn(*shape: int) -> Tensor:
            return torch.randn(*shape, generator=generator, dtype=torch.float64)

        actor, critic = (
            nn.Sequential(nn.Linear(OBS, 8), nn.Tanh(), nn.Linear(8, size)).double() for size in (2 * ACT, 1)
        )
        for tensor in (*actor.parameters(), *critic.parameters()):
            nn.init.normal_(tensor, std=0.4, generator=generator)
        actor[2].bias.data[ACT:] += 0.3  # type: ignore[operator, index]
        obs, policy = randn(STEPS, OBS), ScenePolicy(actor)
        with torch.no_grad():
            loc, log_scale = actor(obs).chunk(2, -1)
            latent = loc + log_scale.exp() * randn(STEPS, ACT)
            old = policy.log_prob(obs, latent)
        critic = nn.Sequential(*critic, nn.Flatten(0))
        steps = randn(STEPS) + 0.2, 3 * randn(STEPS), old
        batch = Batch(obs, latent, None, None, None, randn(STEPS, OBS))
        return cls(policy, critic, batch, *steps)

    def with_ratios(self, ratio: Tensor) -> Scene:
        """Change the stored log-probabilities so that the present policy has these ratios."""
        return dataclasses.replace(self, old_log_prob=self.old_log_prob - ratio.log())

    def with_advantages(self, advantage: Tensor) -> Scene:
        """Change the advantages."""
        return dataclasses.replace(self, advantage=advantage)

    def loss(
        self, function: Loss, entropy_coef: float = 0.0, value_coef: float = 0.0, clip_range: float = EPSILON
    ) -> Tensor:
        """Return a loss's value for this minibatch."""
        steps = self.advantage, self.to_go, self.old_log_prob
        return function(self.policy, self.critic, self.batch, *steps, clip_range, entropy_coef, value_coef)

    def gradients(self, loss: Tensor) -> tuple[Tensor, Tensor]:
        """Return the gradients for policy and critic, a vector each; zero where the loss does not depend on it."""

        def gradient(network: nn.Sequential) -> Tensor:
            parameters = list(network.parameters())
            found = torch.autograd.grad(
                loss, parameters, allow_unused=True, retain_graph=True, materialize_grads=True
            )
            return torch.cat([each.flatten() for each in found])

        return gradient(self.policy.net), gradient(self.critic)

    def weighted_score(self, weights: Tensor) -> Tensor:
        """Return −mean(weights ∇log π), what a loss's gradient for the policy should be."""
        log_prob = self.policy.log_prob(self.batch.obs, self.batch.latent)
        return self.gradients(-(weights * log_prob).mean())[0]


def _close(a: Tensor, b: Tensor) -> bool:
    return a.shape == b.shape and torch.allclose(a, b, rtol=1e-6, atol=1e-9)


def policy_loss(function: Loss, scene: Scene) -> Tensor:
    """Return a loss without entropy and without values."""
    return scene.loss(function)


def _starts_at_one(function: Loss) -> str | None:
    scene = Scene.of(1)
    given = scene.advantage.clone()
    value = policy_loss(function, scene).detach()
    if not torch.equal(given, scene.advantage):
        return "it changes the advantages given to it, as -= and /= do; they come normalised from the update"
    mean = scene.advantage.mean()
    if value.shape != ():
        return f"the loss must be one number, got the shape {list(value.shape)}"
    if _close(value, -mean):
        return None
    if _close(value, mean):
        return "it has the wrong sign: Adam goes downhill, so the loss is minus the surrogate"
    if _close(value, -scene.advantage.sum()):
        return "that is a sum over the minibatch; take the mean"
    scale = scene.critic(scene.batch.obs).sub(scene.to_go).square().mean().detach()
    known = {
        "value_coef does not reach the critic's error: here it is 0": scale - mean,
        "it is 0, and must not be: value_coef multiplies the critic's error alone, and the advantages come normalised "
        "from the update": 0 * mean,
        "the surrogate's third argument is the advantage, not to_go": -scene.to_go.mean(),
        "the surrogate takes the advantage third and old_log_prob fourth": _of_swapped(scene),
    }
    for words, wrong in known.items():
        if _close(value, wrong):
            return words
    return (
        "the policy has not moved, so every ratio is 1 and the loss must be minus the mean advantage. Are the latents "
        "scored as they were drawn, and summed over the action's dimensions? are value_coef and entropy_coef used? "
        "here both are 0"
    )


def _of_swapped(scene: Scene) -> Tensor:
    """The loss of a surrogate that took the advantages for log-densities, and the other way round."""
    ratio, weight = (scene.old_log_prob - scene.advantage).exp(), scene.old_log_prob
    return -torch.minimum(ratio * weight, ratio.clamp(1 - EPSILON, 1 + EPSILON) * weight).mean()


def _weighs_by_the_ratio(function: Loss) -> str | None:
    scene = Scene.of(2)
    ratio = torch.linspace(0.85, 1.15, STEPS, dtype=torch.float64)
    moved = scene.with_ratios(ratio)
    gradient = moved.gradients(policy_loss(function, moved))[0]
    if _close(gradient, moved.weighted_score(ratio * moved.advantage)):
        return None
    if _close(gradient, moved.weighted_score(moved.advantage)):
        return (
            "the ratio is 1 whatever the policy has done since: divide by the density that *drew* the latent, which is "
            "stored"
        )
    return "inside 1 ± ε the gradient must be minus the mean of w Â ∇log π"


def _leaves_the_way_back_open(function: Loss) -> str | None:
    scene = Scene.of(3)
    ratio = torch.linspace(0.3, 0.7, STEPS, dtype=torch.float64)
    moved = scene.with_ratios(ratio).with_advantages(scene.advantage.abs() + 0.1)
    gradient = moved.gradients(policy_loss(function, moved))[0]
    if _close(gradient, moved.weighted_score(ratio * moved.advantage)):
        return None
    if not gradient.any():
        return (
            "actions that were better than expected have become *less* likely, w < 1 − ε, and the loss does not bring "
            "them back: clip the gain, not the loss of it"
        )
    return "for Â > 0 and w < 1 − ε the clip has no say: the gradient must be minus the mean of w Â ∇log π"


def _knows_bad_actions(function: Loss) -> str | None:
    scene = Scene.of(4)
    advantage = -scene.advantage.abs() - 0.1
    for low, high, alive in ((1.3, 1.7, True), (0.3, 0.7, False)):
        ratio = torch.linspace(low, high, STEPS, dtype=torch.float64)
        moved = scene.with_ratios(ratio).with_advantages(advantage)
        gradient = moved.gradients(policy_loss(function, moved))[0]
        wanted = moved.weighted_score(ratio * advantage)
        if not alive and _close(gradient, wanted):
            return (
                "of the actions that were worse than expected, those with w < 1 − ε must be left alone: nothing is "
                "clipped there"
            )
        if not _close(gradient, wanted if alive else 0 * wanted):
            where = "w > 1 + ε must still be pushed down" if alive else "w < 1 − ε must be left alone"
            return (
                f"of the actions that were worse than expected, those with {where}: multiply by Â *before* you take "
                "the minimum"
            )
    return _turns_at(function, scene.with_advantages(advantage), 1 - EPSILON)


def _stops_paying(function: Loss) -> str | None:
    scene = Scene.of(5)
    scene = scene.with_advantages(scene.advantage.abs() + 0.1)
    moved = scene.with_ratios(torch.linspace(1.3, 1.7, STEPS, dtype=torch.float64))
    gradient = moved.gradients(policy_loss(function, moved))[0]
    if gradient.any():
        return "for Â > 0 and w > 1 + ε the surrogate is flat: nothing may push these ratios further up"
    if not moved.gradients(moved.loss(function, clip_range=1.0))[0].any():
        return "clip_range does not reach the surrogate: 1 + clip_range was 2, ratios below it were clipped: pass it on"
    return _turns_at(function, scene, 1 + EPSILON)


def _turns_at(function: Loss, scene: Scene, corner: float) -> str | None:
    """Look at ratios on both sides of a corner: beyond it, for advantages of one sign, nothing may be paid."""
    ratio = torch.linspace(corner - 0.05, corner + 0.05, STEPS, dtype=torch.float64)
    moved = scene.with_ratios(ratio)
    paid = ratio < corner if corner > 1 else ratio > corner
    wanted = moved.weighted_score(ratio * moved.advantage * paid)
    if _close(moved.gradients(policy_loss(function, moved))[0], wanted):
        return None
    return f"the surrogate must turn flat at w = {corner:g}, where clip_range is {EPSILON}: clamp w to 1 ± clip_range"


def _teaches_the_critic(function: Loss) -> str | None:
    scene = Scene.of(6)
    if scene.gradients(policy_loss(function, scene))[1].any():
        return "the surrogate moves the critic: the advantages are constants"
    gradient = scene.gradients(scene.loss(function, value_coef=0.5))
    prediction = scene.critic(scene.batch.obs)
    right = scene.gradients(0.5 * (prediction - scene.to_go).square().mean())[1]
    spread = scene.gradients(0.5 * (prediction[:, None] - scene.to_go).square().mean())[1]
    if _close(gradient[1], spread):
        return (
            "[B, 1] minus [B] is [B, B]: every value is compared with every return, and the critic learns their mean. "
            "Both must have the shape [B]"
        )
    after = scene.critic(scene.batch.next_obs)
    if _close(gradient[1], scene.gradients(0.5 * (after - scene.to_go).square().mean())[1]):
        return "to_go is what batch.obs are worth: ask the critic about batch.obs, not about next_obs"
    error = prediction - scene.to_go
    known = {
        "that is half the squared error: value_coef is the only factor": error.square().mean() / 4,
        "that is the squared error times 1: multiply it by value_coef": error.square().mean(),
        "that is a sum: take the mean of the squared errors": error.square().sum() / 2,
        "that is the square of the mean error: square first, then take the mean": error.mean().square() / 2,
        "that is the mean of the absolute errors: square them": error.abs().mean() / 2,
        "the error is not squared": error.mean() / 2,
        "the critic learns to_go, not the advantage": (prediction - scene.advantage).square().mean() / 2,
    }
    for words, wrong in known.items():
        if _close(gradient[1], scene.gradients(wrong)[1]):
            return words
    if not gradient[1].any():
        return "no gradient reaches the critic: detach nothing of critic(batch.obs)"
    if not _close(gradient[1], right):
        return (
            "the critic's gradient must be that of value_coef times the mean of (critic(batch.obs) − to_go)²"
        )
    if not _close(gradient[0], scene.gradients(policy_loss(function, scene))[0]):
        return "the value loss moves the policy"
    return None


def _pays_for_entropy(function: Loss) -> str | None:
    scene = Scene.of(7)
    still = scene.with_advantages(0 * scene.advantage)
    gradient = still.gradients(still.loss(function, entropy_coef=0.1))[0]
    right = still.gradients(-0.1 * still.policy.entropy(still.batch.obs).mean())[0]
    if _close(gradient, right):
        return None
    if _close(gradient, -right):
        return "the bonus has the wrong sign: the loss must fall when the entropy rises"
    if not gradient.any():
        return "the entropy bonus is missing: minus entropy_coef times the mean of policy.entropy(batch.obs)"
    if _close(gradient, STEPS * right):
        return "the entropies are summed: take their mean"
    return (
        "with no advantage, the policy's gradient must be minus entropy_coef times that of the mean entropy"
    )


CHECKS: Mapping[str, Check] = MappingProxyType(
    {
        "starts at one": _starts_at_one,
        "weighs by the ratio": _weighs_by_the_ratio,
        "leaves the way back open": _leaves_the_way_back_open,
        "knows bad actions": _knows_bad_actions,
        "stops paying": _stops_paying,
        "teaches the critic": _teaches_the_critic,
        "pays for entropy": _pays_for_entropy,
    }
)
"""Name → check of a loss, in the order in which they run."""
