"""Graders of the chapter *TRPO* (`judging` tells how one works): one for each function of the program that it writes.

A policy step is judged by the named checks of `inbounds.book.exercises.checks.trpo`, on problems whose answer dense
linear algebra knows; the verdict names the first that fails. A whole update is judged by where it takes the weights,
beside `inbounds.learning.trpo.update`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import torch
from torch import Tensor
from torch.nn.utils import parameters_to_vector

from inbounds.book.exercises.checks import trpo_updates
from inbounds.book.exercises.checks.small_updates import explained
from inbounds.book.exercises.checks.trpo import (
    CHECKS,
    DAMPING,
    MAX_KL,
    Problem,
    Step,
    parallel,
    problem,
    round_problem,
)
from inbounds.book.exercises.judging import Case, Judgement, judge_by_checks, judge_cases, judge_diagnosis

__all__ = [
    "conjugate_gradient",
    "diagnosis",
    "line_search",
    "natural_step",
    "trpo_step",
    "update",
]


def trpo_step(function: Step) -> Judgement:
    """A policy step of TRPO, by the named checks.

    Args:
        function: the reader's ``trpo_step(gain, mean_kl, weights, max_kl, damping)``; it moves the weights, a list of
            tensors, and ``gain()`` and ``mean_kl()`` look at them.

    Example:
        >>> trpo_step(lambda gain, mean_kl, weights, **numbers: None)
        ✗ not yet: <lambda>: check "direction": it does not move, although every short step uphill is allowed
    """

    def answered() -> bool:
        posed = problem()
        weights = posed.weights()
        return function(*posed.of(weights), weights, max_kl=MAX_KL, damping=DAMPING) is not ...

    return judge_by_checks(function, CHECKS, answered, fallback="your step")


def diagnosis(answers: Mapping[Any, Any], steps: Mapping[Any, Step]) -> Judgement:
    """Which check stops which broken step, as the reader predicts it.

    Args:
        answers: the reader's, by step: the name of the check that fails.
        steps: the broken steps, under the same names.

    Example:
        >>> diagnosis({1: "length"}, {1: lambda gain, mean_kl, weights, **numbers: None})
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


def conjugate_gradient(function: Callable[..., Any]) -> Judgement:
    """Conjugate gradients: the best point of the Krylov space after two steps, the solution after all.

    Args:
        function: the reader's ``conjugate_gradient(product, b, iterations)``.

    Example:
        >>> conjugate_gradient(lambda product, b, iterations: b)
        ✗ not yet: <lambda>: that is b itself: nothing is solved
    """
    posed = problem()
    matrix, b = posed.damped, posed.gradient
    given: list[Tensor] = []

    def best(k: int) -> Tensor:  # by the theorem: nearest to the solution in the matrix's own norm
        space = torch.stack([torch.linalg.matrix_power(matrix, i) @ b for i in range(k)], 1)
        return space @ torch.linalg.solve(space.T @ matrix @ space, space.T @ b)

    def walk(
        k: int,
        beta: Callable[..., Any] = lambda new, old, length: new / old,
        shrink: Callable[[Tensor, Tensor], Tensor] = lambda image, direction: image,
        along: Callable[[Tensor, Tensor, Tensor], Tensor] = lambda direction, image, residual: direction,
        alpha: Callable[[Tensor, Tensor, Tensor], Tensor] = lambda square, direction, image: (
            square / (direction @ image)
        ),
        once: bool = False,
    ) -> Tensor:
        x, residual, direction = torch.zeros_like(b), b, b
        for _ in range(k):
            image, square = matrix @ direction, b @ b if once else residual @ residual
            length = alpha(square, direction, image)
            x = x + length * along(direction, image, residual)
            residual = residual - length * shrink(image, direction)
            direction = residual + beta(residual @ residual, square, length) * direction
        return x

    def case(k: int) -> Case:
        mistakes = {
            "that is b itself: nothing is solved": b,
            "the new direction forgets the old one: that is steepest descent, β is missing": walk(
                k, lambda new, old, length: 0
            ),
            "β is 1: the squared residual was overwritten before β was computed from it": walk(
                k, lambda new, old, length: 1
            ),
            "β is upside down: the new squared residual over the old one": walk(
                k, lambda new, old, length: old / new
            ),
            "the old direction is weighed by the two squared residuals, new over old, not by the step's length": walk(
                k, lambda new, old, length: length
            ),
            "the residual falls by the length times the *image* of the direction, not the direction": walk(
                k, shrink=lambda image, direction: direction
            ),
            "the residual falls: subtract α · image from it": walk(k, shrink=lambda image, direction: -image),
            "x goes along the direction, not along its image": walk(
                k, along=lambda direction, image, residual: image
            ),
            "x goes along the direction, not along the residual": walk(
                k, along=lambda direction, image, residual: residual
            ),
            "α is upside down": walk(k, alpha=lambda square, direction, image: (direction @ image) / square),
            "α divides by direction · image, not by image · image": walk(
                k, alpha=lambda square, direction, image: square / (image @ image)
            ),
            "α has the *squared* residual above the line, residual @ residual, not its root": walk(
                k, alpha=lambda square, direction, image: square**0.5 / (direction @ image)
            ),
            "the old direction is *added* to the new residual": walk(k, lambda new, old, length: -new / old),
            "the squared residual is computed once: it changes in every iteration": walk(k, once=True),
            "x starts at 0, not at b": b + best(k),
            "it returns after one iteration: the return belongs behind the loop": best(1),
            "the number of iterations is not used": best(2),
            "the number of iterations is not used: range(iterations)": best(4),
            "the sign is wrong: it solves for −b": -best(k),
            "that is the residual: return x": b - matrix @ best(k),
        }
        given.append(b.clone())
        return Case(
            (lambda v: matrix @ v, given[-1], k),
            best(k),
            mistakes,
            hint=f"it is not the point nearest to the solution that {k} products of b can reach",
        )

    easy = torch.ones(3, dtype=torch.float64)
    done = {"when the residual has vanished, the next step divides 0 by 0: stop before": easy * torch.nan}
    cases = [case(1), case(2), case(4), Case((lambda v: 2 * v, easy, 5), easy / 2, done)]
    verdict = judge_cases(
        function, cases, "right: the best that so many products allow, and it stops when it is done"
    )
    if any(not torch.equal(each, b) for each in given):
        alias = "residual and direction are other names of it, and += or -= writes into it: residual = residual − …"
        return Judgement(verdict.exercise, False, f"b itself was changed: {alias}")
    return verdict


def natural_step(function: Callable[..., Any]) -> Judgement:
    """The full step √(2D / xᵀ(F + c_F Id)x) x with (F + c_F Id) x = b, from the surrogate and the divergence.

    Args:
        function: the reader's ``natural_step(gain, mean_kl, weights, max_kl, damping)``; it returns a vector `[P]`
            and leaves the weights alone.

    Example:
        >>> natural_step(lambda *arguments: ...)
        … not answered: <lambda>: write it, and run this cell again
    """
    posed = problem()
    right, weights = posed.full(), posed.weights()
    x, plain = torch.linalg.solve(posed.damped, posed.gradient), posed.gradient
    undamped, image = torch.linalg.solve(posed.fisher, posed.gradient), posed.damped @ plain
    mistakes = {
        "½ xᵀ(F + c_F Id)x is max_kl/2: there is a 2 under the root": right / 2**0.5,
        "the fraction under the root is upside down": ((x @ plain) / (2 * MAX_KL)).sqrt() * x,
        "the 2 stands on the wrong side of the fraction": right / 2,
        "under the root stands x · product(x), not b · b": (2 * MAX_KL / (plain @ plain)).sqrt() * x,
        "under the root stands x · product(x), not b · product(b)": (
            2 * MAX_KL / (plain @ posed.damped @ plain)
        ).sqrt()
        * x,
        "that is the product with b: solve with conjugate_gradient": (
            2 * MAX_KL / (image @ posed.damped @ image)
        ).sqrt()
        * image,
        "b is the gradient of gain(): that of mean_kl() is 0 here": right * torch.nan,
        "the root is missing": 2 * MAX_KL / (x @ plain) * x,
        "that is x: give it the length √(2 max_kl / xᵀ(F + c_F Id)x)": x,
        "the Euclidean length is √(2 max_kl): measure with the damped product": (2 * MAX_KL / (x @ x)).sqrt()
        * x,
        "it walks downhill: the surrogate is to be made large": -right,
        "measure the length with the damped product, as the solve does": (
            2 * MAX_KL / (x @ posed.fisher @ x)
        ).sqrt()
        * x,
        "the damping is missing": (2 * MAX_KL / (undamped @ plain)).sqrt() * undamped,
        "that is the plain gradient: the curvature does not get into the product": (
            2 * MAX_KL / (plain @ plain) / DAMPING
        ).sqrt()
        * plain,
        "that is the plain gradient, with the length of the damped product": (
            2 * MAX_KL / (plain @ posed.damped @ plain)
        ).sqrt()
        * plain,
    }
    hint = (
        "½ xᵀ(F + c_F Id)x = max_kl and (F + c_F Id) x ∥ b do not both hold. Does product(v) return Fv + damping · v? "
        "does conjugate_gradient take its ten iterations?"
    )
    case = Case((*posed.of(weights), weights, MAX_KL, DAMPING), right, mistakes, hint)
    verdict = judge_cases(function, [case], "right: direction and length are those of dense algebra")
    if verdict.passed and not torch.equal(parameters_to_vector(weights).detach(), posed.start):
        return Judgement(
            verdict.exercise, False, "the weights have moved: that is the line search's business"
        )
    return verdict


def line_search(function: Callable[..., Any]) -> Judgement:
    """The longest of full, full/2, full/4, … that keeps both promises, by the checks *trust*, *improvement*, *refusal*.

    Args:
        function: the reader's ``line_search(gain, mean_kl, weights, full, max_kl)``, which moves the weights.

    Example:
        >>> line_search(lambda *arguments: None)
        ✗ not yet: <lambda>: check "length": the full step keeps both promises, and is to be taken
    """

    def step(gain: Any, mean_kl: Any, weights: Sequence[Tensor], max_kl: float, damping: float) -> Any:
        slope = torch.cat([each.flatten() for each in torch.autograd.grad(gain(), weights)])
        full = (
            (2 * max_kl / (2 + damping)) ** 0.5 * slope / slope.norm()
        )  # the curvature of `round_problem` is 2
        return function(gain, mean_kl, weights, full, max_kl)

    def whole(function: Step) -> str:
        posed = round_problem()
        if parallel(posed.moved(function), posed.full()) and torch.allclose(
            posed.moved(function), posed.full(), rtol=1e-6
        ):
            return ""
        return "the full step keeps both promises, and is to be taken"

    def trust(function: Step) -> str:
        posed, tried = round_problem(steep=950.0), []
        weights = posed.weights()
        gain, mean_kl = posed.of(weights)

        def watched() -> Tensor:
            tried.append((parameters_to_vector(weights).detach() - posed.start).norm())
            return mean_kl()

        function(gain, watched, weights, MAX_KL, DAMPING)
        if max(tried, default=0.0) > 1.01 * posed.full().norm():
            return (
                "a shorter step is added to weights that have moved already: every length starts at the *old* weights. "
                "Keep a copy of them; list(weights) is none, parameters_to_vector(weights) is one"
            )
        return CHECKS["trust"](function) or halves(function, round_problem(steep=950.0))

    def improvement(function: Step) -> str:
        full = round_problem().full()
        bend = (
            round_problem().gradient @ full / (0.6 * full @ full)
        ).item()  # half the step gains less than a quarter
        return CHECKS["improvement"](function) or halves(function, round_problem(bend=bend))

    def halves(function: Step, posed: Problem) -> str:
        """Whether the first of full, full/2, … that will do was taken."""

        def will_do(length: float) -> bool:
            there = posed.start + length * posed.full()
            return bool(posed.mean_kl(there) <= MAX_KL and posed.surrogate(there) > posed.level)

        first = next(length for length in (0.5**k for k in range(10)) if will_do(length))
        taken = (posed.moved(function).norm() / posed.full().norm()).item()
        if abs(taken - first) < 1e-6:
            return ""
        return f"of the full step, of 1/2, 1/4, … of it the *first* that will do is {first:g}; yours is {taken:.2g}"

    def answered() -> bool:
        posed = round_problem()
        weights = posed.weights()
        return step(*posed.of(weights), weights, MAX_KL, DAMPING) is not ...

    step.__name__ = getattr(function, "__name__", "line_search")
    checks = {"length": whole, "trust": trust, "improvement": improvement, "refusal": CHECKS["refusal"]}
    return judge_by_checks(step, checks, answered)


def update(function: Callable[..., Any]) -> Judgement:
    """A whole update: where it takes the weights of both networks, beside the package.

    Args:
        function: the reader's ``update(policy, critic, adam, batch, max_kl, passes, size)``, which changes the networks
            in place; it shuffles with `torch.randperm`, once a pass.

    Example:
        >>> update(lambda *arguments, **options: None)
        … not answered: <lambda>: the weights have not moved: write it, and run this cell again
    """
    name = getattr(function, "__name__", "your function")
    try:
        complaint = trpo_updates.complaint(function)
    except Exception as error:
        return Judgement(name, False, explained(error))
    if complaint is None:
        return Judgement(name, None, "the weights have not moved: write it, and run this cell again")
    right = "its weights are the package's, of the policy and of the critic"
    return Judgement(name, False, complaint) if complaint else Judgement(name, True, right)
