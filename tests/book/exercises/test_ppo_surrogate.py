"""The grader of PPO's surrogate names the known mistakes, of its value and of its gradient."""

from collections.abc import Callable

import pytest
import torch

from inbounds.book.exercises import ppo as graders
from tests.book.exercises.test_ppo import capped, right_surrogate


def test_a_surrogate_without_its_gradient_does_not_pass() -> None:
    def numbers_alone(policy, *rest):
        return right_surrogate(policy, *rest).detach()

    def half(policy, batch, advantage, old, clip_range):
        ratio = torch.exp(policy.log_prob(batch.obs, batch.latent) - old)
        return (
            capped(ratio, advantage, clip_range) + capped(ratio.detach(), advantage, clip_range)
        ).mean() / 2

    assert graders.surrogate(right_surrogate).passed is True
    assert "no gradient reaches the policy" in graders.surrogate(numbers_alone).message
    assert "its gradient is not" in graders.surrogate(half).message
    assert graders.surrogate(numbers_alone).passed is graders.surrogate(half).passed is False


def test_a_surrogate_that_asks_the_policy_the_wrong_way_round_does_not_pass() -> None:
    def swapped(policy, batch, *rest):
        return right_surrogate(policy, type(batch)(obs=batch.latent, latent=batch.obs), *rest)

    verdict = graders.surrogate(swapped)
    assert verdict.passed is False
    assert "batch.obs first" in verdict.message


def surrogate_of(function: Callable) -> Callable:
    def surrogate(policy, batch, advantage, old_log_prob, clip_range):
        ratio = torch.exp(policy.log_prob(batch.obs, batch.latent) - old_log_prob)
        return function(ratio, advantage, clip_range)

    return surrogate


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda w, a, e: a.mean(), "no ratio"),
        (lambda w, a, e: capped(1 / w, a, e).mean(), "upside down"),
        (lambda w, a, e: torch.minimum(w.log() * a, a + e * a.abs()).mean(), "logarithm"),
        (lambda w, a, e: (w * a).mean(), "nothing is clipped"),
        (lambda w, a, e: (w.clamp(1 - e, 1 + e) * a).mean(), "without the minimum"),
        (lambda w, a, e: (torch.minimum(w, w.clamp(1 - e, 1 + e)) * a).mean(), "not of the two ratios"),
        (lambda w, a, e: torch.maximum(w * a, w.clamp(1 - e, 1 + e) * a).mean(), "larger of the two"),
        (lambda w, a, e: -capped(w, a, e).mean(), "minus the surrogate"),
        (lambda w, a, e: capped(w, a, e).sum(), "take the mean"),
        (capped, "one number is wanted"),
        (lambda w, a, e: capped(w, a, 0.2).mean(), "not always 0.2"),
    ],
)
def test_known_mistakes_of_the_surrogate_are_named(wrong: Callable, words: str) -> None:
    verdict = graders.surrogate(surrogate_of(wrong))
    assert verdict.passed is False
    assert words in verdict.message


def test_a_quotient_of_log_densities_is_no_ratio() -> None:
    def quotient(policy, batch, advantage, old_log_prob, clip_range):
        return capped(policy.log_prob(batch.obs, batch.latent) / old_log_prob, advantage, clip_range).mean()

    assert "subtract the log-densities" in graders.surrogate(quotient).message
