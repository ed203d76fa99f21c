"""The graders of *PPO, step by step* pass the right answers and name the known mistakes."""

from collections.abc import Callable
from typing import Any

import pytest
import torch
from torch import nn

from inbounds.book.exercises import ppo as graders
from inbounds.book.ppo_checks import CHECKS


def surrogate(ratio, advantage, clip_range):
    """By cases, as a decision and not as a minimum."""
    flat = torch.sign(advantage) * (ratio - 1) > clip_range
    return torch.where(flat, (1 + clip_range * torch.sign(advantage)) * advantage, ratio * advantage)


def loss_with(change: str = "") -> Callable[..., Any]:
    """A right loss, or one with a mistake."""

    def ppo_loss(actor, critic, batch, law, clip_range=0.2, entropy_coef=1e-4, value_coef=0.5):
        outputs = actor(batch.obs)
        latent = batch.latent.clamp(-1, 1) if change == "executed" else batch.latent
        log_prob = law.log_prob(outputs, latent)
        old = log_prob.detach() if change == "own density" else batch.log_prob
        ratio = torch.exp(log_prob - old)
        clipped = ratio.clamp(1 - clip_range, 1 + clip_range)
        gain = {
            "": surrogate(ratio, batch.advantage, clip_range),
            "no minimum": clipped * batch.advantage,
            "minimum first": torch.minimum(ratio, clipped) * batch.advantage,
            "no clip": ratio * batch.advantage,
        }.get(change, surrogate(ratio, batch.advantage, clip_range))
        gain = gain.sum() if change == "sum" else gain.mean()
        value = critic(batch.obs) if change == "broadcast" else critic(batch.obs)[:, 0]
        error = (value - batch.return_).square().mean()
        if change == "leak":  # no other value, another gradient
            gain = gain + (value - value.detach()).mean()
        if change == "coupled":
            error = error + (outputs - outputs.detach()).mean()
        if change == "values doubled":
            error = 2 * error
        bonus = entropy_coef * law.entropy(outputs).mean()
        signs = {"uphill": (1, 1), "entropy sign": (-1, 1), "no entropy": (-1, 0)}.get(change, (-1, -1))
        return value_coef * error + signs[0] * gain + signs[1] * bonus

    return ppo_loss


def test_a_right_loss_passes_every_check() -> None:
    verdict = graders.ppo_loss(loss_with())
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
        ("broadcast", "teaches the critic", "[B, B]"),
        ("values doubled", "teaches the critic", "value_coef"),
        ("leak", "teaches the critic", "the advantages are constants"),
        ("coupled", "teaches the critic", "moves the policy"),
        ("entropy sign", "pays for entropy", "wrong sign"),
        ("no entropy", "pays for entropy", "minus entropy_coef"),
    ],
)
def test_every_broken_loss_is_stopped_by_its_check(change: str, check: str, words: str) -> None:
    verdict = graders.ppo_loss(loss_with(change))
    assert verdict.passed is False
    assert verdict.message.startswith(f'check "{check}"')
    assert words in verdict.message


def test_a_surrogate_that_never_stops_paying_is_seen() -> None:
    """Right for bad actions, without an upper corner for good ones."""

    def ppo_loss(actor, critic, batch, law, clip_range, entropy_coef, value_coef):
        ratio = torch.exp(law.log_prob(actor(batch.obs), batch.latent) - batch.log_prob)
        paid = torch.where(
            batch.advantage > 0, ratio * batch.advantage, surrogate(ratio, batch.advantage, clip_range)
        )
        return -paid.mean()

    assert 'check "stops paying"' in graders.ppo_loss(ppo_loss).message


def test_the_checks_say_when_a_loss_is_not_written_or_raises() -> None:
    assert graders.ppo_loss(lambda *_: ...).passed is None
    verdict = graders.ppo_loss(lambda actor, *_: actor(torch.zeros(2)))
    assert verdict.passed is False
    assert "raised RuntimeError" in verdict.message
    assert "one number" in graders.ppo_loss(lambda a, c, batch, *_: -batch.advantage).message


LOSSES = {name: loss_with(name) for name in ("executed", "own density", "no minimum", "broadcast")}
RIGHT = dict(
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
    assert graders.diagnosis(RIGHT, LOSSES).passed is True
    verdict = graders.diagnosis(RIGHT | changed, LOSSES)
    assert verdict.passed is False
    assert words in verdict.message
    assert graders.diagnosis(RIGHT | {"executed": ...}, LOSSES).passed is None


def update_with(change: str = "") -> Callable[..., None]:
    """A right update, or one with a mistake."""

    def ppo_update(actor, critic, optimizer, data, law, rng, **options):
        epochs, size, norm = (options.pop(k) for k in ("num_epochs", "minibatch_size", "max_grad_norm"))
        options |= {"value_coef": 1.0} if change == "values" else {}
        options |= {"entropy_coef": 0.0} if change == "entropy" else {}
        options |= {"clip_range": 0.2} if change == "clip range" else {}
        advantage = data.advantage
        if change == "whole":
            advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
        once = rng.permutation(len(data.obs))
        for epoch in range(1 if change == "one pass" else epochs):
            order = once if epoch == 0 or change == "one order" else rng.permutation(len(data.obs))
            for start in range(0, len(order), size):
                index = torch.from_numpy(order[start : start + size])
                part = advantage[index]
                if change not in ("whole", "raw"):
                    part = (part - part.mean()) / (part.std() + 1e-8)
                columns = {name: column[index] for name, column in data._asdict().items()}
                batch = type(data)(**columns | {"advantage": part})
                if change != "accumulate":
                    optimizer.zero_grad()
                loss_with()(actor, critic, batch, law, **options).backward()
                if change == "apart":
                    for network in (actor, critic):
                        nn.utils.clip_grad_norm_(network.parameters(), norm)
                elif change != "free":
                    nn.utils.clip_grad_norm_([*actor.parameters(), *critic.parameters()], norm)
                optimizer.step()

    return ppo_update


def test_a_right_update_ends_where_the_package_ends() -> None:
    verdict = graders.ppo_update(update_with())
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
        ("accumulate", "zero_grad"),
        ("apart", "one norm over both"),
    ],
)
def test_known_mistakes_of_an_update_are_named(change: str, words: str) -> None:
    verdict = graders.ppo_update(update_with(change))
    assert verdict.passed is False
    assert words in verdict.message


def test_an_update_that_raises_or_does_nothing() -> None:
    assert graders.ppo_update(lambda *_, **__: None).passed is None
    assert "raised TypeError" in graders.ppo_update(lambda actor: None).message


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda r, a, e: r * a, "nothing is clipped"),
        (lambda r, a, e: r.clamp(1 - e, 1 + e) * a, "without the minimum"),
        (lambda r, a, e: torch.minimum(r, r.clamp(1 - e, 1 + e)) * a, "not of the two ratios"),
        (lambda r, a, e: torch.maximum(r * a, r.clamp(1 - e, 1 + e) * a), "larger of the two"),
        (lambda r, a, e: -surrogate(r, a, e), "minus the surrogate"),
        (lambda r, a, e: surrogate(r, a, 0.2), "expected"),
    ],
)
def test_known_mistakes_of_the_surrogate_are_named(wrong: Callable, words: str) -> None:
    assert graders.clipped_surrogate(surrogate).passed is True
    verdict = graders.clipped_surrogate(wrong)
    assert verdict.passed is False
    assert words in verdict.message


def test_there_are_seven_checks() -> None:
    assert len(CHECKS) == 7
