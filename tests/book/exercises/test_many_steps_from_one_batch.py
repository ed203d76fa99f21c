"""The graders of the surrogate pass the right answers and name the known mistakes."""

from collections.abc import Callable

import numpy as np
import pytest
import torch
from scipy import stats

from inbounds.book.exercises import many_steps_from_one_batch as graders


def stable(log_ratio):
    weights = torch.softmax(torch.from_numpy(log_ratio), 0)  # an independent road: normalised weights
    return (1 / (weights**2).sum()).item()


def naive(log_ratio):
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        ratio = np.exp(log_ratio)
        return ratio.sum() ** 2 / np.sum(ratio**2)


def quiet(function: Callable) -> Callable:
    def wrapped(log_ratio):
        with np.errstate(all="ignore"):
            return function(log_ratio)

    return wrapped


def centred(log_ratio):
    ratio = np.exp(log_ratio)
    return len(ratio) / (ratio.var() / ratio.mean() ** 2)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda x: stable(x) / len(x), "multiply by n"),
        (lambda x: len(x) / stable(x), "n divided by it"),
        (lambda x: len(x) * np.exp(x).mean() ** 2, "multiplied by a number"),
        (lambda x: np.exp(x).sum() / np.sum(np.exp(x) ** 2), "squared before"),
        (lambda x: x.sum() ** 2 / np.sum(x**2), "exponentiate first"),
        (centred, "second moment that counts"),
        (naive, "1000 overflows"),
        (lambda x: naive(np.minimum(x, x - max(x.max(), 0))), "underflow"),
        (lambda x: stable(x) + 1, "the value is wrong"),
    ],
)
def test_effective_sample_size_mistakes(wrong: Callable, words: str) -> None:
    verdict = graders.effective_sample_size(quiet(wrong))
    assert verdict.passed is False
    assert words in verdict.message


def log_ratios(loc, scale, old_loc, old_scale, latent):
    return stats.norm.logpdf(latent, loc, scale) - stats.norm.logpdf(latent, old_loc, old_scale)


def right(loc, scale, old_loc, old_scale, latent, advantage):
    ratio = np.prod(np.exp(log_ratios(loc, scale, old_loc, old_scale, latent)), axis=1)
    return np.mean(ratio * advantage)


def printed(loc, scale, old_loc, old_scale, latent, advantage):
    """The exercise as it is printed, both errors included."""
    ratio = np.exp(log_ratios(loc, scale, old_loc, scale, latent)).mean(axis=1)
    return np.mean(ratio * advantage)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (printed, "both errors"),
        (lambda *a: np.mean(np.exp(log_ratios(*a[:5])).mean(1) * a[5]), "not the mean"),
        (lambda *a: np.mean(np.exp(log_ratios(*a[:5]).mean(1)) * a[5]), "do not average them"),
        (lambda m, s, mo, so, z, adv: right(m, s, mo, s, z, adv), "the old scale"),
        (lambda *a: np.mean(np.exp(log_ratios(*a[:5])).sum(1) * a[5]), "multiply them"),
        (lambda m, s, mo, so, z, adv: right(mo, so, m, s, z, adv), "swapped"),
        (lambda *a: right(*a) * len(a[5]), "take their mean"),
        (lambda *a: np.mean(log_ratios(*a[:5]).sum(1) * a[5]), "not exponentiated"),
        (lambda *a: right(*a) + 1, "the value is wrong"),
    ],
)
def test_surrogate_mistakes(wrong: Callable, words: str) -> None:
    verdict = graders.surrogate_of(wrong)
    assert verdict.passed is False
    assert words in verdict.message


def growing(policy, batch, advantage, old_log_prob):
    return ((policy.log_prob(batch.obs, batch.latent) - old_log_prob).exp() * advantage).mean()


def log_prob_of(policy, batch):
    return policy.log_prob(batch.obs, batch.latent)


RIGHT = {"effective_sample_size": stable, "surrogate_of": right}


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda p, b, a, old: growing(p, b, a, old).detach(), "no gradient reaches"),
        (lambda p, b, a, old: ((log_prob_of(p, b) - old) * a).mean(), "not exponentiated"),
        (lambda p, b, a, old: ((old - log_prob_of(p, b)).exp() * a).mean(), "swapped"),
        (lambda *x: -growing(*x), "to be ascended"),
        (lambda p, b, a, old: growing(p, b, a, old) * len(a), "take its mean"),
        (lambda p, b, a, old: (log_prob_of(p, b) - old).exp() * a, "return one number"),
        (lambda p, b, a, old: (log_prob_of(p, b) * a).mean(), "without a ratio"),
        (lambda *x: growing(*x) + 1, "the value is wrong"),
        (lambda p, b, a, old: p.log_probs, "AttributeError"),
        (lambda p, b, a, old: ((p.log_prob(b.latent, b.obs) - old).exp() * a).mean(), "batch.obs first"),
    ],
)
def test_mistakes_of_the_growing_program(wrong: Callable, words: str) -> None:
    verdict = graders.surrogate(wrong)
    assert verdict.passed is False
    assert words in verdict.message


def test_the_growing_program_s_surrogate_passes() -> None:
    assert graders.surrogate(growing).passed is True


def test_a_clipped_surrogate_is_told_from_this_one() -> None:
    def clipped(policy, batch, advantage, old):
        ratio = torch.exp(policy.log_prob(batch.obs, batch.latent) - old)
        return torch.minimum(ratio * advantage, ratio.clamp(0.8, 1.2) * advantage).mean()

    assert "PPO's, clipped" in graders.surrogate(clipped).message
