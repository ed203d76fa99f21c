"""Grader of the page *What TRPO's details do* (`judging` tells how one works)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from torch.distributions import Normal, kl_divergence

from inbounds.book.exercises.judging import Case, Judgement, detached, judge_cases

__all__ = ["linear_fisher_product"]


def linear_fisher_product(function: Callable[..., Any]) -> Judgement:
    """F v for a Gaussian policy with location W φ(s) and one free log σ per action dimension.

    Args:
        function: the reader's ``linear_fisher_product(features, log_scale, v_weight, v_log_scale)`` of arrays
            `[B, K]`, `[A]`, `[A, K]`, `[A]`; it returns the two blocks of F v, `[A, K]` and `[A]`.

    Example:
        >>> linear_fisher_product(lambda *arguments: ...)
        … not answered: <lambda>: write it, and run this cell again
    """

    def joined(*arguments: Any) -> Any:
        answer = function(*arguments)
        if answer is ... or answer is None:
            return answer
        weight, log_scale = detached(tuple(answer))
        return _join(weight, log_scale)

    joined.__name__ = getattr(function, "__name__", "linear_fisher_product")
    rng = np.random.default_rng(0)
    cases = [_linear_case(rng, *sizes) for sizes in ((7, 3, 2), (4, 5, 1))]
    return judge_cases(joined, cases, "right: the Hessian of the mean KL divergence, without a Hessian")


def _linear_case(rng: np.random.Generator, states: int, features: int, act_dim: int) -> Case:
    phi, log_scale = rng.normal(size=(states, features)), rng.normal(size=act_dim)
    v, u = rng.normal(size=(act_dim, features)), rng.normal(size=act_dim)
    weight, log = _hessian_product(phi, log_scale, v, u)
    scale, second = np.exp(log_scale), phi.T @ phi / states
    mistakes = {
        "the curvature of log σ is 2, whatever σ is": _join(weight, u),
        "the curvature of log σ is 2; 2/σ² is that of σ": _join(weight, 2 * u / scale**2),
        "the location's block is divided by σ², not σ": _join(weight * scale[:, None], log),
        "the location's block is *divided* by σ²": _join(weight * scale[:, None] ** 4, log),
        "that is a sum over states in the location's block: take the mean": _join(states * weight, log),
        "the features of one state meet each other: φφᵀ, not φ²": _join(
            v * np.diag(second) / scale[:, None] ** 2, log
        ),
        "E[φ]E[φ]ᵀ is not E[φφᵀ]: average the outer products": _join(
            v @ np.outer(phi.mean(0), phi.mean(0)) / scale[:, None] ** 2, log
        ),
    }
    return Case((phi, log_scale, v, u), _join(weight, log), mistakes)


def _hessian_product(
    phi: np.ndarray, log_scale: np.ndarray, v: np.ndarray, u: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """F v by two backward passes over torch's divergence: not the formula that the reader is asked for."""
    features, v_weight, v_log = (torch.tensor(x) for x in (phi, v, u))
    weight = torch.zeros_like(v_weight, requires_grad=True)
    log = torch.tensor(log_scale, requires_grad=True)
    new = Normal(features @ weight.T, log.exp())
    old = Normal(new.loc.detach(), new.scale.detach())
    kl = kl_divergence(old, new).sum(1).mean()
    slope = torch.autograd.grad(kl, (weight, log), create_graph=True)
    along = (slope[0] * v_weight).sum() + (slope[1] * v_log).sum()
    first, second = torch.autograd.grad(along, (weight, log))
    return first.numpy(), second.numpy()


def _join(weight: Any, log_scale: Any) -> np.ndarray:
    return np.concatenate([np.ravel(np.asarray(weight, float)), np.ravel(np.asarray(log_scale, float))])
