"""The graders of the chapter on lockstep pass right answers and name the known mistakes."""

from collections.abc import Callable

import pytest
import torch
from torch import Tensor

from inbounds.book.exercises import ten_seeds_as_one as graders
from inbounds.learning.advantages import normalize_advantage
from inbounds.learning.networks.adam import clip_gradients
from inbounds.learning.ppo import clipped_surrogate


def norms(gradients: list[Tensor]) -> Tensor:
    return torch.cat([g.flatten(1) for g in gradients], 1).norm(dim=1)


def scaled(gradients: list[Tensor], factor: Tensor) -> list[Tensor]:
    return [g * factor.view(-1, *[1] * (g.dim() - 1)) for g in gradients]


def clip(gradients: list[Tensor], max_norm: float) -> list[Tensor]:
    return scaled(gradients, (max_norm / norms(gradients)).clamp(max=1))


def clip_in_place(gradients: list[Tensor], max_norm: float) -> None:
    clip_gradients([g.view(len(g), -1) for g in gradients], max_norm)  # the package's, on views


def clip_jointly(gradients: list[Tensor], max_norm: float) -> list[Tensor]:
    for g in gradients:
        g.requires_grad_().grad = g.detach().clone()
    torch.nn.utils.clip_grad_norm_(gradients, max_norm)
    return [g.grad for g in gradients]


def clip_with_nan(gradients: list[Tensor], max_norm: float) -> list[Tensor]:
    """Right, but for a maximum over seeds that lets a NaN through."""
    return scaled(clip(gradients, max_norm), torch.ones(3) + 0 * norms(gradients).max())


def clip_where_too_long(gradients: list[Tensor], max_norm: float) -> list[Tensor]:
    """As the task says it; NaN exceeds nothing, so a poisoned seed's other numbers stay as they are."""
    norm = norms(gradients)
    return scaled(gradients, torch.where(norm > max_norm, max_norm / norm, 1.0))


@pytest.mark.parametrize("right", [clip, clip_in_place, clip_where_too_long])
def test_clipping_per_seed_passes(right: Callable) -> None:
    assert graders.clip_per_seed(right).passed is True


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (clip_jointly, "one norm for all seeds"),
        (lambda g, m: [c for x in g for c in clip([x], m)], "runs over all of them"),
        (lambda g, m: scaled(g, m / norms(g)), "must not exceed 1"),
        (lambda g, m: [x.clamp(-m, m) for x in g], "the direction changes"),
        (lambda g, m: scaled(g, (m / norms(g) ** 2).clamp(max=1)), "square root"),
        (lambda g, m: None, "nothing was clipped"),
        (clip_with_nan, "a NaN in one seed"),
        (lambda g, m: [x.nan_to_num() for x in clip(g, m)], "a NaN in one seed"),
        (lambda g, m: g[:1], "array of shape"),
    ],
)
def test_mistakes_in_clipping_are_named(wrong: Callable, words: str) -> None:
    verdict = graders.clip_per_seed(wrong)
    assert verdict.passed is False
    assert words in verdict.message


def loss(lp: Tensor, old: Tensor, a: Tensor, v: Tensor, r: Tensor) -> Tensor:
    surrogate = clipped_surrogate(lp, old, normalize_advantage(a), 0.2)
    return (0.5 * (v - r).square() - surrogate).mean(1).sum()


def loss_with(normalize: Callable, reduce: Callable, sign: float = 1.0) -> Callable:
    def wrong(lp, old, a, v, r):
        return reduce(0.5 * (v - r) ** 2 - sign * clipped_surrogate(lp, old, normalize(a), 0.2))

    return wrong


def jointly(a: Tensor) -> Tensor:
    return (a - a.mean()) / (a.std() + 1e-8)


def within(x: Tensor) -> Tensor:
    return x.mean(1).sum()


def test_a_loss_in_lockstep_passes() -> None:
    assert graders.lockstep_loss(loss).passed is True


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (loss_with(jointly, torch.mean), "both lines"),
        (loss_with(jointly, within), "over all seeds"),
        (loss_with(normalize_advantage, torch.mean), "a mean over seeds"),
        (loss_with(lambda a: normalize_advantage(a.T).T, within), "*last* axis"),
        (loss_with(normalize_advantage, torch.sum), "a sum over the minibatch"),
        (loss_with(normalize_advantage, within, -1.0), "the sign"),
        (loss_with(lambda a: a, within), "some gradient"),
        (loss_with(normalize_advantage, lambda x: x.mean(1)), "one number"),
    ],
)
def test_mistakes_in_the_loss_are_named(wrong: Callable, words: str) -> None:
    verdict = graders.lockstep_loss(wrong)
    assert verdict.passed is False
    assert words in verdict.message


@pytest.mark.parametrize("name", graders.__all__)
def test_an_unanswered_exercise_is_not_a_failure(name: str) -> None:
    assert getattr(graders, name)(lambda *_: ...).passed is None
