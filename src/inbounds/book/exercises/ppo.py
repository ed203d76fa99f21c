"""Graders of the chapter *PPO, step by step* (`judging` tells how one works).

A loss is judged by the named checks of `inbounds.book.ppo_checks`; the verdict names the first that fails. A whole
update is judged by where it takes the weights, beside `inbounds.learning.ppo.update`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from inbounds.book.exercises.judging import Case, Judgement, judge_by_checks, judge_cases, judge_diagnosis
from inbounds.book.ppo_checks import ACT, CHECKS, GAUSSIAN, OBS, STEPS, Loss, Scene, policy_loss
from inbounds.learning import ActorCritic, NetworkConfig, Policy, PolicyConfig, PPOConfig, Rollout, ppo
from inbounds.learning.updates.minibatches import Minibatch

__all__ = ["clipped_surrogate", "diagnosis", "ppo_loss", "ppo_update"]

_COEFFICIENTS = (
    "num_epochs",
    "minibatch_size",
    "max_grad_norm",
    "clip_range",
    "entropy_coef",
    "value_coef",
)


def clipped_surrogate(function: Callable[..., Any]) -> Judgement:
    """min(r Â, clip(r) Â), elementwise.

    Args:
        function: the reader's ``clipped_surrogate(ratio, advantage, clip_range)``, of tensors.

    Example:
        >>> clipped_surrogate(lambda ratio, advantage, clip_range: ratio * advantage)
        ✗ not yet: <lambda>: nothing is clipped: a good action is paid for every rise of its ratio
    """

    def case(ratio: list[float], advantage: list[float], clip_range: float) -> Case:
        r, a = np.array(ratio), np.array(advantage)
        clipped = np.clip(r, 1 - clip_range, 1 + clip_range)
        first = r * a
        mistakes = {
            "nothing is clipped: a good action is paid for every rise of its ratio": first,
            "without the minimum, a ratio that moved the wrong way gets no gradient back": clipped * a,
            "take the smaller of the two products, not of the two ratios: it matters where Â < 0": np.minimum(
                r, clipped
            )
            * a,
            "that is the larger of the two: the surrogate is pessimistic": np.maximum(first, clipped * a),
            "that is minus the surrogate: it is maximised; the loss takes the minus": -np.minimum(
                first, clipped * a
            ),
        }
        # What a capped gain says in one line, unlike the chapter's solution.
        expected = np.minimum(first, a + clip_range * np.abs(a))
        return Case((torch.tensor(r), torch.tensor(a), clip_range), expected, mistakes)

    six = [0.5, 1.05, 1.7, 0.5, 1.05, 1.7], [2.0, 2.0, 2.0, -1.0, -1.0, -1.0]
    return judge_cases(function, [case(*six, 0.2), case(*six, 0.02)], "right, in all six cases")


def ppo_loss(function: Loss) -> Judgement:
    """PPO's loss of one minibatch, by the named checks.

    Args:
        function: the reader's ``ppo_loss(actor, critic, batch, law, clip_range, entropy_coef, value_coef)``.

    Example:
        >>> ppo_loss(lambda *arguments: ...)
        … not answered: <lambda>: write it, and run this cell again
    """

    def answered() -> bool:
        return isinstance(policy_loss(function, Scene.of(0)), Tensor)

    return judge_by_checks(function, CHECKS, answered)


def diagnosis(answers: Mapping[str, Any], losses: Mapping[str, Loss]) -> Judgement:
    """Which check stops which broken loss, as the reader predicts it.

    Args:
        answers: the reader's, by loss: the name of the first check that fails.
        losses: the broken losses, under the same names.

    Example:
        >>> diagnosis({"A": ...}, {"A": lambda *_: torch.zeros(3)})
        … not answered: diagnosis: name a check for every loss, and run this cell again
    """
    stopped_before, lets_pass = "an earlier check stops it", "it gets past that one"
    return judge_diagnosis(answers, losses, CHECKS, "loss", stopped_before, lets_pass)


class _OneOrder:
    """A generator that shuffles in the same way each time: the mistake of shuffling once."""

    def __init__(self, seed: int) -> None:
        self.seed = seed

    def permutation(self, length: int) -> np.ndarray:
        return np.random.default_rng(self.seed).permutation(length)


def ppo_update(function: Callable[..., Any]) -> Judgement:
    """A whole update: where it takes the weights, beside the package.

    Args:
        function: the reader's ``ppo_update(actor, critic, optimizer, data, law, rng, num_epochs, minibatch_size,
            max_grad_norm, clip_range, entropy_coef, value_coef)``, which changes the networks in place.

    Example:
        >>> ppo_update(lambda *arguments, **options: None)
        … not answered: <lambda>: the weights have not moved: write it, and run this cell again
    """
    name = getattr(function, "__name__", "your function")
    config = PPOConfig(
        horizon=STEPS, minibatch_size=16, num_epochs=3, learning_rate=1e-2, entropy_coef=0.05, clip_range=0.1
    )
    start = _networks()
    actor, critic = (_sequential(net) for net in start.networks)
    before = _weights(actor, critic)
    optimizer = torch.optim.Adam([*actor.parameters(), *critic.parameters()], 1e-2, eps=config.adam_eps)
    options = {key: getattr(config, key) for key in _COEFFICIENTS}
    rng = np.random.default_rng(8)
    try:
        function(actor, critic, optimizer, _data(start), GAUSSIAN, rng, **options)
    except Exception as error:
        return Judgement(name, False, f"it raised {type(error).__name__}: {error}")
    after = _weights(actor, critic)
    if torch.equal(before, after):
        return Judgement(name, None, "the weights have not moved: write it, and run this cell again")
    if _same(after, _package(config)):
        return Judgement(name, True, "its weights are the package's, after every minibatch of three passes")
    for mistake, wrong in _mistakes(config).items():
        if _same(after, wrong):
            return Judgement(name, False, mistake)
    hints = "zero_grad before every backward? one norm over both networks? the stored log-probabilities left alone?"
    return Judgement(
        name, False, f"the weights end elsewhere than the package's, in no way that is known: {hints}"
    )


def _same(a: Tensor, b: Tensor) -> bool:
    return torch.allclose(a, b, rtol=1e-6, atol=1e-8)


def _mistakes(config: PPOConfig) -> dict[str, Tensor]:
    """Diagnosis → the weights that this mistake leads to."""

    def changed(**values: Any) -> Tensor:
        return _package(dataclasses.replace(config, **values))

    return {
        "advantages are normalised over the whole batch; do it in each minibatch": _package(
            dataclasses.replace(config, normalize_advantage=False), whole=True
        ),
        "the advantages are not normalised": changed(normalize_advantage=False),
        "the steps are shuffled once; shuffle anew in each pass": _package(config, _OneOrder(8)),
        "only one pass is made over the data": changed(num_epochs=1),
        "the gradient is not clipped": changed(max_grad_norm=None),
        "the entropy bonus is missing": changed(entropy_coef=0.0),
        "value_coef is not used": changed(value_coef=1.0),
        "clip_range is not used": changed(clip_range=0.2),
    }


def _networks() -> ActorCritic:
    policy = Policy(PolicyConfig("gaussian"), -np.ones(ACT), np.ones(ACT))
    network = NetworkConfig(hidden_sizes=(8, 8), dtype="float64", policy_head_gain=0.5)
    return ActorCritic(policy, OBS, network, [torch.Generator().manual_seed(3)])


def _sequential(net: Any) -> nn.Sequential:
    """The one seed of an `Mlp` as torch's own layers."""
    layers: list[nn.Module] = []
    for layer in net.layers:
        size_out, size_in = layer.weight.shape[1:]
        linear = nn.Linear(size_in, size_out).double()
        linear.weight.data.copy_(layer.weight[0])
        linear.bias.data.copy_(layer.bias[0, :, 0])
        layers += [linear, nn.Tanh()]
    return nn.Sequential(*layers[:-1])


def _weights(*networks: nn.Sequential) -> Tensor:
    return torch.cat([p.detach().flatten().clone() for net in networks for p in net.parameters()])


def _data(networks: ActorCritic) -> Minibatch:
    """The steps `[T]` of one seed: drawn by the policy, with advantages and returns of no meaning."""
    generator = torch.Generator().manual_seed(9)
    obs, noise = (
        torch.randn(1, STEPS, size, generator=generator, dtype=torch.float64) for size in (OBS, ACT)
    )
    advantage, return_ = torch.randn(2, STEPS, generator=generator, dtype=torch.float64)
    with torch.no_grad():
        parameters = networks.parameters(obs)
        loc, log_scale = parameters
        latent = loc + log_scale.exp() * noise
        log_prob = networks.policy.law.log_prob(parameters, latent)
    return Minibatch(obs[0], latent[0], log_prob[0], 2 * advantage + 1, 3 * return_)


def _package(config: PPOConfig, generator: Any = None, whole: bool = False) -> Tensor:
    """The weights after the package's update of the same networks on the same steps.

    Args:
        config: the numbers.
        generator: orders the minibatches.
        whole: normalise the advantages beforehand.
    """
    networks = _networks()
    data = Minibatch(*(column[None] for column in _data(networks)))
    advantage = data.advantage
    if whole:
        advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
    ends = torch.ones_like(advantage, dtype=torch.bool)
    value = (
        data.return_ - advantage
    )  # with every step an episode of its own, Â = reward − value and R = reward
    rollout = Rollout(
        obs=data.obs,
        latent=data.latent,
        action=data.latent,
        reward=data.return_,
        terminated=ends,
        truncated=~ends,
        bootstrap=0 * value,
        value=value,
        log_prob=data.log_prob,
        parameters=networks.parameters(data.obs).detach(),
        saturation=np.zeros(1),
        action_std=np.ones(1),
        episode_returns=[[]],
    )
    generators = [np.random.default_rng(8) if generator is None else generator]
    ppo.update(networks, ppo.make_optimizer(networks, config), rollout, generators, config)
    return torch.cat([p.detach().flatten() for net in networks.networks for p in net.parameters])
