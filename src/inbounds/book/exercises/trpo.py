"""Graders of the chapter *TRPO, step by step* (`judging` tells how one works).

A policy step is judged as a black box, ``trpo_step(surrogate, mean_kl, theta, max_kl=δ, damping=c, cg_iters=k)``, on
problems whose answer dense linear algebra knows. Each of the named checks looks at one property alone, so that one
broken line fails one of them:

| Check       | What must hold                                                       |
|-------------|----------------------------------------------------------------------|
| direction   | the step is parallel to (F + cI)⁻¹ g                                 |
| length      | ½ Δᵀ(F + cI)Δ = δ, where the line search has nothing to do           |
| trust       | where the quadratic model fails, the exact KL divergence stays ≤ δ   |
| improvement | where the linear model fails, the surrogate still goes up            |
| refusal     | where no length will do, the parameters stay as they were            |
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.distributions import Normal, kl_divergence

from inbounds.book.exercises.judging import (
    Case,
    Judgement,
    detached,
    judge_by_checks,
    judge_cases,
    judge_diagnosis,
)

__all__ = ["CHECKS", "diagnosis", "linear_fisher_product", "trpo_step"]

Step = Callable[..., Tensor]

MAX_KL, DAMPING, CG_ITERS = 0.02, 0.1, 8
SIZE = 4


@dataclass(frozen=True)
class Problem:
    """A surrogate and a divergence of Δ = θ − θ_old in closed form.

    The surrogate is gᵀΔ − bend·|Δ|²; the divergence is q + steep·q² with q = ½ΔᵀFΔ: the Hessian at Δ = 0 is F.
    """

    fisher: Tensor
    """`[P, P]`."""
    gradient: Tensor
    """`[P]`."""
    bend: float = 0.0
    steep: float = 0.0

    @property
    def start(self) -> Tensor:
        """θ_old `[P]`; not zero, for that would hide a lost start."""
        return torch.linspace(-1.0, 2.0, SIZE, dtype=torch.float64)

    @property
    def damped(self) -> Tensor:
        """F + cI `[P, P]`."""
        return self.fisher + DAMPING * torch.eye(SIZE, dtype=torch.float64)

    def surrogate(self, theta: Tensor) -> Tensor:
        """Return the surrogate, 0 at the start."""
        step = theta - self.start
        return step @ self.gradient - self.bend * (step @ step)

    def mean_kl(self, theta: Tensor) -> Tensor:
        """Return the divergence, 0 at the start."""
        step = theta - self.start
        square = step @ self.fisher @ step / 2
        return square + self.steep * square**2

    def moved(self, function: Step) -> Tensor:
        """Return Δ `[P]` of a reader's step; it may not change the vector that it was given."""
        theta = self.start
        after = function(
            self.surrogate, self.mean_kl, theta, max_kl=MAX_KL, damping=DAMPING, cg_iters=CG_ITERS
        )
        if not torch.equal(theta, self.start):
            raise ValueError("theta was changed in place: work on a copy, and return it")
        return after.detach() - self.start


def _problem(**shape: float) -> Problem:
    """A problem whose curvature differs from direction to direction by a factor of a hundred."""
    axes = torch.linalg.qr(torch.arange(16.0, dtype=torch.float64).reshape(4, 4).sin())[0]
    curvature = torch.tensor([5.0, 1.0, 0.3, 0.05], dtype=torch.float64)
    gradient = torch.tensor([0.6, -0.3, 0.5, 0.4], dtype=torch.float64)
    return Problem(axes @ torch.diag(curvature) @ axes.T, gradient, **shape)


def _round(**shape: float) -> Problem:
    """A problem whose curvature is the same in all directions: any solver finds the direction."""
    gradient = torch.tensor([0.6, -0.3, 0.5, 0.4], dtype=torch.float64)
    return Problem(2 * torch.eye(SIZE, dtype=torch.float64), gradient, **shape)


def _parallel(a: Tensor, b: Tensor) -> bool:
    return bool(a @ b > (1 - 1e-8) * a.norm() * b.norm())


def _direction(function: Step) -> str:
    problem = _problem()
    step = problem.moved(function)
    if not step.any():
        return "it does not move, although every short step uphill is allowed"
    right = torch.linalg.solve(problem.damped, problem.gradient)
    if _parallel(step, right):
        return ""
    known = {
        "it walks downhill: the surrogate is to be made large": -right,
        "that is the plain gradient: the curvature does not get into the product": problem.gradient,
        "the damping is missing from the solve": torch.linalg.solve(problem.fisher, problem.gradient),
        "that is the damped matrix times g: solve with it": problem.damped @ problem.gradient,
    }
    for diagnosis_, wrong in known.items():
        if _parallel(step, wrong):
            return diagnosis_
    return "the step does not solve (F + cI) x = g: compare the solver with torch.linalg.solve"


def _length(function: Step) -> str:
    problem = _problem()
    step = problem.moved(function)
    spent = (step @ problem.damped @ step / 2).item()
    undamped = (step @ problem.fisher @ step / 2).item()
    without_root = (
        2 * MAX_KL**2 / (problem.gradient @ torch.linalg.solve(problem.damped, problem.gradient)).item()
    )

    def near(a: float, b: float) -> bool:
        return abs(a - b) < 1e-7 * MAX_KL

    if near(spent, MAX_KL):
        return ""
    if near(spent, MAX_KL / 2):
        return "½Δᵀ(F + cI)Δ is δ/2: there is a 2 under the root"
    if near(undamped, MAX_KL) or near(4 * undamped, MAX_KL):  # rounding may have cost it one halving
        return "½ΔᵀFΔ is δ: measure the length with the damped product, as the solve does"
    if near((step @ step / 2).item(), MAX_KL):
        return "the Euclidean length is √(2δ): measure with the damped product"
    if near(spent, without_root):
        return "the root is missing"
    return f"½Δᵀ(F + cI)Δ is {spent / MAX_KL:.3g} δ, and should be δ"


def _trust(function: Step) -> str:
    for steep in (150.0, 950.0):  # the full step costs 3.7 and 18 δ, half of it 0.4 and 1.3 δ
        problem = _round(steep=steep)
        step = problem.moved(function)
        if not step.any():
            return "it gives up, although a shorter step of the same direction keeps KL ≤ δ: backtrack"
        spent = problem.mean_kl(problem.start + step).item()
        if spent > MAX_KL * (1 + 1e-9):
            return (
                f"the exact KL divergence is {spent / MAX_KL:.2g} δ: accept a length only where mean_kl itself, at the "
                "new parameters, is at most δ"
            )
    return ""


def _improvement(function: Step) -> str:
    problem = _round(bend=8.0)
    step = problem.moved(function)
    if not step.any():
        return "it gives up, although a shorter step of the same direction improves the surrogate: backtrack"
    gain = problem.surrogate(problem.start + step).item()
    if gain <= 0:
        return f"the surrogate changed by {gain:.2g}: accept a length only if the surrogate goes up"
    return ""


def _refusal(function: Step) -> str:
    step = _round(bend=1e9, steep=1e30).moved(function)
    if step.any():
        return "no length was acceptable, yet the parameters moved: return the old ones"
    return ""


CHECKS: Mapping[str, Callable[[Step], str]] = {
    "direction": _direction,
    "length": _length,
    "trust": _trust,
    "improvement": _improvement,
    "refusal": _refusal,
}
"""By name, in the order in which they are run: what is wrong with a step, or nothing."""


def trpo_step(function: Step) -> Judgement:
    """A policy step of TRPO, by the named checks.

    Args:
        function: the reader's ``trpo_step(surrogate, mean_kl, theta, max_kl, damping, cg_iters)``; it maps two
            functions of the parameters and the parameters `[P]` to new parameters.

    Example:
        >>> trpo_step(lambda surrogate, mean_kl, theta, **numbers: theta)
        ✗ not yet: <lambda>: check "direction": it does not move, although every short step uphill is allowed
    """
    problem = _problem()

    def answered() -> bool:
        answer = function(problem.surrogate, problem.mean_kl, problem.start, max_kl=MAX_KL, damping=DAMPING,
                          cg_iters=CG_ITERS)  # fmt: skip
        return isinstance(answer, Tensor)

    return judge_by_checks(function, CHECKS, answered, fallback="your step")


def diagnosis(answers: Mapping[Any, Any], steps: Mapping[Any, Step]) -> Judgement:
    """Which check stops which broken step, as the reader predicts it.

    Args:
        answers: the reader's, by step: the name of the check that fails.
        steps: the broken steps, under the same names.

    Example:
        >>> diagnosis({1: "length"}, {1: lambda surrogate, mean_kl, theta, **numbers: theta})
        ✗ not yet: diagnosis: TRPO 1: it gets as far as "length"? It is stopped before that
    """
    return judge_diagnosis(
        answers,
        steps,
        CHECKS,
        noun="TRPO",
        stopped_before='it gets as far as "{answer}"? It is stopped before that',
        lets_pass='its {answer} is right: "{answer}" lets it pass',
    )


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
