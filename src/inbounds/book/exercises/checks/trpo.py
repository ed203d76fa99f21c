"""What TRPO's policy step must do, as named checks: each looks at one property, and says in words what is wrong.

A policy step is judged as a black box, ``trpo_step(gain, mean_kl, weights, max_kl=D, damping=c)``, which moves the
weights, on problems whose answer dense linear algebra knows. Each of the named checks looks at one property alone, so
that one broken line fails one of them:

| Check       | What must hold                                                       |
|-------------|----------------------------------------------------------------------|
| direction   | the step is parallel to (F + c_F Id)⁻¹ b                           |
| length      | ½ Δᵀ(F + c_F Id)Δ = D, where the line search has nothing to do     |
| trust       | where the quadratic model fails, the exact KL divergence stays ≤ D   |
| improvement | where the linear model fails, the surrogate still goes up            |
| refusal     | where no length will do, the parameters stay as they were            |
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor
from torch.nn.utils import parameters_to_vector

__all__ = ["CHECKS", "DAMPING", "MAX_KL", "Problem", "Step", "parallel", "problem", "round_problem"]

Step = Callable[..., Any]

MAX_KL, DAMPING = 0.02, 0.1
SIZE = 4


@dataclass(frozen=True)
class Problem:
    """A surrogate and a divergence of Δ = θ − θ_old in closed form.

    The surrogate is level + gᵀΔ − bend·|Δ|²; the divergence is q + steep·q² with q = ½ΔᵀFΔ: the Hessian at Δ = 0 is F.
    """

    fisher: Tensor
    """`[P, P]`."""
    gradient: Tensor
    """`[P]`."""
    bend: float = 0.0
    steep: float = 0.0
    level: float = 0.0
    """The surrogate at the start."""
    edge: float = math.inf
    """From this |Δ|² on, the surrogate is as it was at the start."""

    @property
    def start(self) -> Tensor:
        """θ_old `[P]`; not zero, for that would hide a lost start."""
        return torch.linspace(-1.0, 2.0, SIZE, dtype=torch.float64)

    @property
    def damped(self) -> Tensor:
        """F + c_F Id `[P, P]`."""
        return self.fisher + DAMPING * torch.eye(SIZE, dtype=torch.float64)

    def surrogate(self, theta: Tensor) -> Tensor:
        """Return the surrogate."""
        step = theta - self.start
        square = step @ step
        return self.level + (square < self.edge) * (step @ self.gradient - self.bend * square)

    def mean_kl(self, theta: Tensor) -> Tensor:
        """Return the divergence, 0 at the start."""
        step = theta - self.start
        square = step @ self.fisher @ step / 2
        return square + self.steep * square**2

    def weights(self) -> list[torch.nn.Parameter]:
        """Return θ_old in two pieces, as a network has it."""
        start = self.start.clone()
        return [torch.nn.Parameter(start[:1].clone()), torch.nn.Parameter(start[1:].clone())]

    def of(self, weights: list[torch.nn.Parameter]) -> tuple[Callable[[], Tensor], Callable[[], Tensor]]:
        """Return the surrogate and the divergence as functions without arguments, of the weights as they are."""
        return (
            lambda: self.surrogate(parameters_to_vector(weights)),
            lambda: self.mean_kl(parameters_to_vector(weights)),
        )

    def full(self) -> Tensor:
        """Return the full step `[P]`, by dense algebra."""
        x = torch.linalg.solve(self.damped, self.gradient)
        return (2 * MAX_KL / (x @ self.gradient)).sqrt() * x

    def moved(self, function: Step) -> Tensor:
        """Return Δ `[P]`: how far a reader's step has moved the weights."""
        weights = self.weights()
        function(*self.of(weights), weights, max_kl=MAX_KL, damping=DAMPING)
        return parameters_to_vector(weights).detach() - self.start


def problem(**shape: float) -> Problem:
    """A problem whose curvature differs from direction to direction by a factor of a hundred."""
    axes = torch.linalg.qr(torch.arange(16.0, dtype=torch.float64).reshape(4, 4).sin())[0]
    curvature = torch.tensor([5.0, 1.0, 0.3, 0.05], dtype=torch.float64)
    gradient = torch.tensor([0.6, -0.3, 0.5, 0.4], dtype=torch.float64)
    return Problem(axes @ torch.diag(curvature) @ axes.T, gradient, **shape)


def round_problem(**shape: float) -> Problem:
    """A problem whose curvature is the same in all directions: any solver finds the direction."""
    gradient = torch.tensor([0.6, -0.3, 0.5, 0.4], dtype=torch.float64)
    return Problem(2 * torch.eye(SIZE, dtype=torch.float64), gradient, **shape)


def parallel(a: Tensor, b: Tensor) -> bool:
    """Say whether two vectors point the same way."""
    return bool(a @ b > (1 - 1e-8) * a.norm() * b.norm())


def _direction(function: Step) -> str:
    posed = problem()
    step = posed.moved(function)
    if not step.any():
        return "it does not move, although every short step uphill is allowed"
    right = torch.linalg.solve(posed.damped, posed.gradient)
    if parallel(step, right):
        return ""
    known = {
        "it walks downhill: the surrogate is to be made large": -right,
        "that is the plain gradient: the curvature does not get into the product": posed.gradient,
        "the damping is missing from the solve": torch.linalg.solve(posed.fisher, posed.gradient),
        "that is the damped matrix times b: solve with it": posed.damped @ posed.gradient,
    }
    for diagnosis_, wrong in known.items():
        if parallel(step, wrong):
            return diagnosis_
    return "the step does not solve (F + c_F Id) x = b: compare the solver with torch.linalg.solve"


def _length(function: Step) -> str:
    posed = problem()
    step = posed.moved(function)
    spent = (step @ posed.damped @ step / 2).item()
    undamped = (step @ posed.fisher @ step / 2).item()
    without_root = 2 * MAX_KL**2 / (posed.gradient @ torch.linalg.solve(posed.damped, posed.gradient)).item()

    def near(a: float, b: float) -> bool:
        return abs(a - b) < 1e-7 * MAX_KL

    if near(spent, MAX_KL):
        return ""
    if near(spent, MAX_KL / 2):
        return "½Δᵀ(F + c_F Id)Δ is max_kl/2: there is a 2 under the root"
    if near(undamped, MAX_KL) or near(4 * undamped, MAX_KL):  # rounding may have cost it one halving
        return "½ΔᵀFΔ is max_kl: measure the length with the damped product, as the solve does"
    if near((step @ step / 2).item(), MAX_KL):
        return "the Euclidean length is √(2 max_kl): measure with the damped product"
    if near(spent, without_root):
        return "the root is missing"
    return f"½Δᵀ(F + c_F Id)Δ is {spent / MAX_KL:.3g} max_kl, and should be max_kl"


def _trust(function: Step) -> str:
    for steep in (150.0, 950.0):  # the full step costs 3.7 and 18 D, half of it 0.4 and 1.3 D
        posed = round_problem(steep=steep)
        step = posed.moved(function)
        if not step.any():
            return "it gives up, although a shorter step keeps the KL divergence below max_kl: backtrack"
        spent = posed.mean_kl(posed.start + step).item()
        if spent > MAX_KL * (1 + 1e-9):
            return (
                f"the exact KL divergence is {spent / MAX_KL:.2g} max_kl: accept a length only where "
                "mean_kl() itself, at the new weights, is at most max_kl"
            )
    return ""


def _improvement(function: Step) -> str:
    posed = round_problem(bend=8.0)
    step = posed.moved(function)
    if not step.any():
        return "it gives up, although a shorter step of the same direction improves the surrogate: backtrack"
    gain = posed.surrogate(posed.start + step).item()
    if gain <= 0:
        return f"the surrogate changed by {gain:.2g}: accept a length only if the surrogate goes up"
    raised = round_problem(bend=8.0, level=5.0)
    if raised.surrogate(raised.start + raised.moved(function)) < raised.level:
        return "a surrogate of 5 fell, and stayed above 0: compare with its value before the step, not with 0"
    square = (posed.full() @ posed.full()).item()
    flat = round_problem(edge=0.5 * square)
    if flat.moved(function) @ flat.moved(function) > flat.edge:
        return (
            "the surrogate was as large as before, and the step was taken: it must be *larger*, > and not >="
        )
    return ""


def _refusal(function: Step) -> str:
    step = round_problem(bend=1e9, steep=1e30).moved(function)
    if step.any():
        return (
            "none of the first ten lengths was acceptable, yet the weights moved: try ten, then put the old ones back "
            "(a copy of them; list(weights) is none)"
        )
    return ""


CHECKS: Mapping[str, Callable[[Step], str]] = {
    "direction": _direction,
    "length": _length,
    "trust": _trust,
    "improvement": _improvement,
    "refusal": _refusal,
}
"""By name, in the order in which they are run: what is wrong with a step, or nothing."""
