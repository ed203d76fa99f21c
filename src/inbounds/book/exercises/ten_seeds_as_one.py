"""Graders of the chapter *Ten seeds as one* (`judging` tells how one works)."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import torch
from torch import Tensor

from inbounds.book.exercises.judging import Case, Judgement, judge_cases

__all__ = ["clip_per_seed", "lockstep_loss"]


def clip_per_seed(function: Callable[..., Any]) -> Judgement:
    """Clipping of gradients by each seed's norm over all tensors, in place or into new ones."""

    @functools.wraps(function)
    def rows(gradients: list[Tensor], max_norm: float) -> Any:
        """The reader's answer as one row per seed; a function that returns nothing may have worked in place.

        A seed with a NaN is lost: whether the rest of its row is scaled, or NaN as well, is nobody's concern.
        """
        ours = [gradient.clone() for gradient in gradients]
        answer = function(ours, max_norm)
        answer = ours if answer is None else answer
        if answer is ...:
            return answer
        found = np.concatenate([_rows(each) for each in answer], 1)
        found[np.isnan(found).any(1)] = np.nan
        return found

    def case(gradients: list[Tensor], max_norm: float) -> Case:
        flat = np.concatenate([_rows(each) for each in gradients], 1)  # [S, P]
        norm = np.sqrt((flat**2).sum(1, keepdims=True))  # [S, 1]
        parts = [_rows(each) for each in gradients]

        def shrunk(x: np.ndarray, by: Any) -> np.ndarray:
            return x * np.minimum(1, max_norm / by)

        mistakes = {
            "nothing was clipped": flat,
            "one norm for all seeds: a seed with a large gradient shortens everyone's": shrunk(
                flat, np.sqrt((flat**2).sum())
            ),
            "each tensor is clipped by its own norm: a seed's norm runs over all of them": np.concatenate(
                [shrunk(part, np.linalg.norm(part, axis=1, keepdims=True)) for part in parts], 1
            ),
            "short gradients are made longer: the factor must not exceed 1": flat * max_norm / norm,
            "the components are clipped, not the norm: the direction changes": np.clip(
                flat, -max_norm, max_norm
            ),
            "the square root of the sum of squares is missing": shrunk(flat, norm**2),
        }
        return Case((gradients, max_norm), shrunk(flat, norm), mistakes, rtol=1e-5)

    generator = torch.Generator().manual_seed(0)
    size = torch.tensor([0.05, 1.0, 20.0])  # of the seeds' gradients: short, middling, long

    def gradients(*shapes: tuple[int, ...]) -> list[Tensor]:
        return [
            size.view(-1, *[1] * len(shape)) * torch.randn(3, *shape, generator=generator) for shape in shapes
        ]

    poisoned = gradients((4, 2), (4, 1))
    poisoned[0][1, 0, 0] = torch.nan
    lost = "a NaN in one seed must stay there: it has reached another, or is gone"
    cases = [
        case(gradients((5,), (3,)), 0.5),
        case(gradients((4, 3), (4, 1), (2, 4), (2, 1)), 1.0),
        replace(case(poisoned, 0.5), mistakes={}, hint=lost),
    ]
    return judge_cases(rows, cases, "right: each seed by its own norm, and a diverged one harms no other")


def lockstep_loss(function: Callable[..., Any]) -> Judgement:
    """The loss of one PPO minibatch of S seeds, judged by its gradients: those of each seed alone."""

    @functools.wraps(function)
    def gradients(*arguments: Tensor) -> Any:
        """Gradients of the reader's loss in log-probabilities and values, `[2, S, B]`."""
        log_prob, value = (arguments[i].clone().requires_grad_() for i in (0, 3))
        answer = function(log_prob, arguments[1], arguments[2], value, arguments[4])
        if not isinstance(answer, Tensor):
            return answer
        if answer.dim():
            raise ValueError(f"autograd wants one number, got the shape {list(answer.shape)}")
        found = torch.autograd.grad(answer, (log_prob, value), allow_unused=True)
        return np.stack([np.zeros(log_prob.shape) if g is None else g.numpy() for g in found])

    def case(num_seeds: int, batch: int) -> Case:
        rng = np.random.default_rng(num_seeds)
        log_prob, old, value, return_ = rng.normal(scale=0.3, size=(4, num_seeds, batch))
        advantage = rng.normal(size=(num_seeds, batch)) * np.logspace(-1, 1, num_seeds)[:, None] + 2.0

        def expected(axis: int | None, per: float) -> np.ndarray:
            """The gradients, by hand: the surrogate is flat where clipping is active."""
            deviation = advantage - advantage.mean(axis, keepdims=True)
            a = deviation / (advantage.std(axis, ddof=1, keepdims=True) + 1e-8)
            ratio = np.exp(log_prob - old)
            flat = ((a > 0) & (ratio > 1.2)) | ((a < 0) & (ratio < 0.8))
            return np.stack([np.where(flat, 0.0, -ratio * a), value - return_]) / per

        everyone = num_seeds * batch
        mistakes = {
            "both lines still couple the seeds: the normalisation, and the mean over everything": expected(
                None, everyone
            ),
            "the advantages are normalised over all seeds: a seed sees its neighbours' returns": expected(
                None, batch
            ),
            "a mean over seeds: each seed's gradient is divided by their number (a sum, please)": expected(
                1, everyone
            ),
            "the advantages are normalised across seeds, step by step: the batch is the *last* axis": expected(
                0, batch
            ),
            "a sum over the minibatch: within a seed the loss is a mean": expected(1, 1),
            "the sign is wrong: the surrogate is to grow, the loss to fall": expected(1, batch)
            * np.array([-1.0, 1.0])[:, None, None],
        }
        arguments = tuple(torch.from_numpy(x) for x in (log_prob, old, advantage, value, return_))
        return Case(arguments, expected(1, batch), mistakes, hint="some gradient is wrong")

    cases = [case(4, 8), case(2, 33)]
    return judge_cases(gradients, cases, "right: every seed's gradients are those of a run alone")


def _rows(tensor: Any) -> np.ndarray:
    return torch.as_tensor(tensor).detach().flatten(1).double().numpy()
