"""The graders of *PPO* pass the right answers and name the known mistakes."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import torch
from torch import nn
from torch.distributions import Normal, kl_divergence

from inbounds.book.exercises import ppo as graders
from inbounds.book.exercises.checks.ppo import CHECKS
from inbounds.book.exercises.checks.small_updates import PPO, Small


def capped(ratio, advantage, clip_range):
    """By cases, as a decision and not as a minimum."""
    flat = torch.sign(advantage) * (ratio - 1) > clip_range
    return torch.where(flat, (1 + clip_range * torch.sign(advantage)) * advantage, ratio * advantage)


def capped_in_the_logarithm(ratio, advantage, clip_range):
    """With corners at e^±ε instead of 1 ± ε."""
    return torch.minimum(ratio * advantage, ratio.log().clamp(-clip_range, clip_range).exp() * advantage)


def right_surrogate(policy, batch, advantage, old_log_prob, clip_range=0.2):
    ratio = torch.exp(policy.log_prob(batch.obs, batch.latent) - old_log_prob)
    return capped(ratio, advantage, clip_range).mean()


def loss_with(change: str = "") -> Callable[..., Any]:
    """A right loss, or one with a mistake."""

    def loss(policy, critic, batch, advantage, to_go, old_log_prob, clip_range, entropy_coef, value_coef):
        clip_range = 0.2 if change == "clip range" else clip_range
        latent = batch.latent.clamp(-1, 1) if change == "executed" else batch.latent
        log_prob = policy.log_prob(batch.obs, latent)
        ratio = torch.exp(log_prob - (log_prob.detach() if change == "own density" else old_log_prob))
        clipped = ratio.clamp(1 - clip_range, 1 + clip_range)
        gain = {
            "no minimum": clipped * advantage,
            "minimum first": torch.minimum(ratio, clipped) * advantage,
            "no clip": ratio * advantage,
            "clipped in the logarithm": capped_in_the_logarithm(ratio, advantage, clip_range),
            "one over": torch.minimum(
                ratio * advantage, ratio.clamp(1 / (1 + clip_range), 1 + clip_range) * advantage
            ),
            "late": torch.where(
                advantage > 0,
                ratio * advantage * (ratio < 1 + 1.2 * clip_range),
                capped(ratio, advantage, clip_range),
            ),
        }.get(change, capped(ratio, advantage, clip_range))
        gain = gain.sum() if change == "sum" else gain.mean()
        value = critic(batch.obs)[:, None] if change == "broadcast" else critic(batch.obs)
        value = critic(batch.next_obs) if change == "next" else value
        error = (value - to_go).square().mean()
        if change == "leak":  # no other value, another gradient
            gain = gain + (value - value.detach()).mean()
        if change == "coupled":
            error = error + (log_prob - log_prob.detach()).mean()
        if change == "values doubled":
            error = 2 * error
        bonus = entropy_coef * policy.entropy(batch.obs).mean()
        signs = {"uphill": (1, 1), "entropy sign": (-1, 1), "no entropy": (-1, 0)}.get(change, (-1, -1))
        return value_coef * error + signs[0] * gain + signs[1] * bonus

    return loss


def test_a_right_loss_passes_every_check() -> None:
    verdict = graders.loss(loss_with())
    assert verdict.passed is True, verdict


@pytest.mark.parametrize(
    ("change", "check", "words"),
    [
        ("executed", "starts at one", "as they were drawn"),
        ("uphill", "starts at one", "wrong sign"),
        ("sum", "starts at one", "take the mean"),
        ("own density", "weighs by the ratio", "whatever the policy has done"),
        ("no minimum", "leaves the way back open", "clip the gain"),
        ("minimum first", "knows bad actions", "before"),
        ("no clip", "knows bad actions", "must be left alone"),
        ("clip range", "stops paying", "does not reach the surrogate"),
        ("clipped in the logarithm", "knows bad actions", "flat at w = 0.8"),
        ("one over", "knows bad actions", "flat at w = 0.8"),
        ("late", "stops paying", "flat at w = 1.2"),
        ("broadcast", "teaches the critic", "[B, B]"),
        ("next", "teaches the critic", "not about next_obs"),
        ("values doubled", "teaches the critic", "value_coef"),
        ("leak", "teaches the critic", "the advantages are constants"),
        ("coupled", "teaches the critic", "moves the policy"),
        ("entropy sign", "pays for entropy", "wrong sign"),
        ("no entropy", "pays for entropy", "minus entropy_coef"),
    ],
)
def test_every_broken_loss_is_stopped_by_its_check(change: str, check: str, words: str) -> None:
    verdict = graders.loss(loss_with(change))
    assert verdict.passed is False
    assert verdict.message.startswith(f'check "{check}"')
    assert words in verdict.message


def test_a_surrogate_that_never_stops_paying_is_seen() -> None:
    """Right for bad actions, without an upper corner for good ones."""

    def loss(policy, critic, batch, advantage, to_go, old, clip_range, entropy_coef, value_coef):
        ratio = torch.exp(policy.log_prob(batch.obs, batch.latent) - old)
        return -torch.where(advantage > 0, ratio * advantage, capped(ratio, advantage, clip_range)).mean()

    assert 'check "stops paying"' in graders.loss(loss).message


def test_a_loss_that_normalises_in_place_is_told_so() -> None:
    def loss(policy, critic, batch, advantage, *rest):
        advantage -= advantage.mean()
        return loss_with()(policy, critic, batch, advantage, *rest)

    assert "it changes the advantages given to it" in graders.loss(loss).message


def test_a_loss_may_ask_the_law_itself() -> None:
    def loss(policy, critic, batch, *rest):
        density = policy.law(policy.net(batch.obs)).log_prob(batch.latent).sum(-1)
        torch.testing.assert_close(density, policy.log_prob(batch.obs, batch.latent))
        return loss_with()(policy, critic, batch, *rest)

    assert graders.loss(loss).passed is True


def test_the_checks_say_when_a_loss_is_not_written_or_raises() -> None:
    assert graders.loss(lambda *_: ...).passed is None
    verdict = graders.loss(lambda policy, *_: policy.net(torch.zeros(2)))
    assert verdict.passed is False
    assert "raised RuntimeError" in verdict.message
    assert "one number" in graders.loss(lambda p, c, b, advantage, *_: -advantage).message


LOSSES = {name: loss_with(name) for name in ("executed", "own density", "no minimum", "broadcast")}
ANSWERS = dict(
    zip(
        LOSSES,
        ["starts at one", "weighs by the ratio", "leaves the way back open", "teaches the critic"],
        strict=True,
    )
)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"executed": "stops paying"}, "loss executed: an earlier check"),
        ({"broadcast": "starts at one"}, "loss broadcast: it gets past"),
        ({"broadcast": "the third"}, "no check is called 'the third'"),
    ],
)
def test_a_wrong_diagnosis_is_told_where(changed: dict[str, str], words: str) -> None:
    assert graders.diagnosis(ANSWERS, LOSSES).passed is True
    verdict = graders.diagnosis(ANSWERS | changed, LOSSES)
    assert verdict.passed is False
    assert words in verdict.message
    assert graders.diagnosis(ANSWERS | {"executed": ...}, LOSSES).passed is None


def right_advantages(batch, critic, gamma=0.99, lam=0.95):
    value, after = critic(batch.obs).detach(), critic(batch.next_obs).detach()
    advantage, later = torch.zeros_like(value), 0.0
    for t in reversed(range(len(value))):
        stays = 1 - batch.terminated[t]
        later = gamma * lam * stays * (1 - batch.truncated[t]) * later
        later = later + batch.reward[t] + gamma * stays * after[t] - value[t]
        advantage[t] = later
    return advantage, advantage + value


def update_with(change: str = "") -> Callable[..., None]:
    """A right update, or one with a mistake."""

    def update(policy, critic, adam, batch, passes, size, **options):
        options |= {"value_coef": 1.0} if change == "values" else {}
        options |= {"entropy_coef": 0.0} if change == "entropy" else {}
        options |= {"clip_range": 0.2} if change == "clip range" else {}
        if change == "no coefficients":
            options = {"clip_range": 0.2, "entropy_coef": 1e-4, "value_coef": 0.5}
        advantage, to_go = right_advantages(batch, critic)
        old = policy.log_prob(batch.obs, batch.latent).detach()
        if change == "own law":
            outputs = policy.net(batch.obs).detach()
            old = policy.law(outputs).log_prob(batch.latent).sum(-1)
        if change == "whole":
            advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
        if change == "swapped":
            advantage, to_go = to_go, advantage
        once = torch.randperm(len(old))
        for epoch in range(1 if change == "one pass" else passes):
            order = once if epoch == 0 or change == "one order" else torch.randperm(len(old))
            if change == "on and on" and epoch:
                once = order = once[order]
            advantage, to_go = (
                right_advantages(batch, critic) if change == "each pass" else (advantage, to_go)
            )
            for start in range(0, len(order), size):
                if change == "each step":
                    advantage, to_go = right_advantages(batch, critic)
                index = order if change == "no pieces" else order[start : start + size]
                part, target = advantage[index], to_go[index]
                if change not in ("whole", "raw"):
                    spread = part.std(unbiased=change != "population") + 1e-8
                    part = (
                        part - part.mean() / spread if change == "bracket" else (part - part.mean()) / spread
                    )
                if change == "targets":
                    target = (target - target.mean()) / (target.std() + 1e-8)
                target = to_go if change == "whole targets" else target
                few = type(batch)(*(column[index] for column in batch))
                if change != "accumulate":
                    adam.zero_grad()
                mine = policy.log_prob(few.obs, few.latent).detach() if change == "own" else old[index]
                factor = {"factor": 16, "accumulated": 1 / 4}.get(change, 1)
                (factor * loss_with()(policy, critic, few, part, target, mine, **options)).backward()
                if change == "emptied":
                    adam.zero_grad()
                both = [*policy.net.parameters()], [*critic.parameters()]
                for weights in both if change == "apart" else ([*both[0], *both[1]],):
                    if change != "free":
                        nn.utils.clip_grad_norm_(weights, 0.5)
                adam.step()

    return update


@pytest.mark.parametrize("way", ["", "own law", "on and on"])
def test_a_right_update_ends_where_the_package_ends(way: str) -> None:
    verdict = graders.update(update_with(way))
    assert verdict.passed is True, verdict


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("whole", "over the whole batch"),
        ("raw", "not normalised"),
        ("one order", "shuffled once"),
        ("one pass", "only one pass"),
        ("free", "not clipped"),
        ("entropy", "entropy bonus is missing"),
        ("values", "value_coef"),
        ("clip range", "clip_range"),
        ("no coefficients", "passed on to loss"),
        ("accumulate", "zero_grad"),
        ("apart", "one norm over both"),
        ("own", "every ratio is 1"),
        ("population", "divides by n − 1"),
        ("bracket", "a bracket is missing"),
        ("targets", "targets are normalised too"),
        ("no pieces", "the whole batch"),
        ("each pass", "anew in each pass"),
        ("each step", "anew in each step"),
        ("swapped", "the advantages first"),
        ("emptied", "without a gradient, and nothing moved: zero_grad, backward"),
        ("whole targets", "piece meets a whole batch"),
        ("factor", "no factor before the loss"),
        ("accumulated", "no factor before the loss"),
    ],
)
def test_known_mistakes_of_an_update_are_named(change: str, words: str) -> None:
    verdict = graders.update(update_with(change))
    assert verdict.passed is False
    assert words in verdict.message


def test_without_a_flaw_the_grader_s_own_loop_is_the_package() -> None:
    torch.testing.assert_close(Small().after_a_flawed(""), Small().after_the_packages(PPO))
    flawed = [Small().after_a_flawed(flaw) for flaw in graders.MISTAKES.values()]
    assert len({tuple(weights.tolist()) for weights in flawed}) == len(graders.MISTAKES)


def test_an_update_that_raises_does_nothing_or_goes_elsewhere() -> None:
    assert graders.update(lambda *_, **__: None).passed is None
    assert "raised TypeError" in graders.update(lambda policy: None).message

    def lost(policy, critic, adam, batch, **_):
        policy.net[0].weight.data += 1.0

    assert "in no way that is known" in graders.update(lost).message


class RightPolicy:
    def __init__(self, obs_dim, box, law, squeeze):
        self.law, self.net = law, nn.Linear(obs_dim, 2 * len(box.low))

    def log_prob(self, obs, latent):
        return self.law(self.net(obs)).log_prob(latent).sum(-1)

    def entropy(self, obs):
        return self.law(self.net(obs)).entropy().sum(-1)

    def kl(self, old, obs):
        return kl_divergence(self.law(old), self.law(self.net(obs))).sum(-1)


def changed(**methods: Callable) -> type:
    return type("Policy", (RightPolicy,), methods)


def law(self, obs: torch.Tensor) -> Normal:
    return self.law(self.net(obs))


@pytest.mark.parametrize(
    ("methods", "words"),
    [
        ({"log_prob": lambda self, obs, z: law(self, obs).log_prob(z)}, "log_prob: a step has one number"),
        (
            {"log_prob": lambda self, obs, z: law(self, obs).log_prob(z).mean(-1)},
            "log_prob: that is the mean",
        ),
        (
            {"log_prob": lambda self, obs, z: law(self, obs).log_prob(z).sum()},
            "log_prob: the shape must be [B]",
        ),
        ({"entropy": lambda self, obs: law(self, obs).entropy()}, "entropy: a step has one number"),
        (
            {"kl": lambda self, old, obs: kl_divergence(law(self, obs), self.law(old)).sum(-1)},
            "kl: it must be KL(old‖new)",
        ),
        ({"kl": lambda self, old, obs: np.zeros(5)}, "kl: a tensor is wanted"),
        ({"entropy": lambda self, obs: ...}, "write entropy"),
    ],
)
def test_known_mistakes_of_a_policy_are_named(methods: dict[str, Callable], words: str) -> None:
    assert graders.policy(RightPolicy).passed is True
    verdict = graders.policy(changed(**methods))
    assert verdict.passed is not True
    assert words in verdict.message


def test_there_are_seven_checks() -> None:
    assert len(CHECKS) == 7
