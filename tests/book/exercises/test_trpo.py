"""The graders of *TRPO, step by step* pass a step found by dense algebra, and name each of five planted bugs."""

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
import torch

from inbounds.book.exercises import trpo as graders
from inbounds.book.exercises.trpo import CHECKS


def step(
    surrogate: Callable,
    mean_kl: Callable,
    theta: torch.Tensor,
    max_kl: float,
    damping: float,
    cg_iters: int,
    *,
    solve: Callable = torch.linalg.solve,
    length: Callable = lambda x, matrix, max_kl: (2 * max_kl / (x @ matrix @ x)).sqrt(),
    allowed: Callable = lambda kl, model, max_kl: kl <= max_kl,
    improved: Callable = lambda after, before: after > before,
    give_up: Callable = lambda theta, candidate: theta,
) -> torch.Tensor:
    """The right step, by a dense Hessian and a dense solver, with a place for every bug."""
    gradient = torch.autograd.functional.jacobian(surrogate, theta)
    matrix = torch.autograd.functional.hessian(mean_kl, theta) + damping * torch.eye(
        len(theta), dtype=theta.dtype
    )
    x = solve(matrix, gradient)
    full = length(x, matrix, max_kl) * x
    for k in range(10):
        delta = 0.5**k * full
        candidate = theta + delta
        within = allowed(mean_kl(candidate), delta @ matrix @ delta / 2, max_kl)
        if within and improved(surrogate(candidate), surrogate(theta)):
            return candidate
    return give_up(theta, candidate)


BROKEN = {
    "direction": partial(step, solve=lambda matrix, g: matrix @ g),
    "length": partial(step, length=lambda x, matrix, max_kl: (max_kl / (x @ matrix @ x)).sqrt()),
    "trust": partial(step, allowed=lambda kl, model, max_kl: model <= max_kl * (1 + 1e-9)),
    "improvement": partial(step, improved=lambda after, before: True),
    "refusal": partial(step, give_up=lambda theta, candidate: candidate),
}


def test_a_right_step_passes() -> None:
    verdict = graders.trpo_step(step)
    assert verdict.passed is True, verdict


def test_a_line_search_that_forgives_a_half_is_seen() -> None:
    verdict = graders.trpo_step(partial(step, allowed=lambda kl, model, max_kl: kl <= 1.5 * max_kl))
    assert verdict.passed is False
    assert 'check "trust": the exact KL divergence is 1.3 δ' in verdict.message


def test_an_unanswered_step_is_not_a_failure() -> None:
    assert graders.trpo_step(lambda *_, **numbers: ...).passed is None


@pytest.mark.parametrize("name", CHECKS)
def test_each_bug_fails_one_check(name: str) -> None:
    failed = [check for check, wrong in CHECKS.items() if wrong(BROKEN[name])]
    assert failed == [name]
    assert f'check "{name}"' in graders.trpo_step(BROKEN[name]).message


def euclidean(x, matrix, max_kl):
    return (2 * max_kl / (x @ x)).sqrt()


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (partial(step, solve=lambda matrix, g: g), "plain gradient"),
        (partial(step, solve=lambda matrix, g: -torch.linalg.solve(matrix, g)), "does not move"),
        (partial(step, solve=lambda matrix, g: -torch.linalg.solve(matrix, g),
                 improved=lambda after, before: True), "downhill"),
        (partial(step, solve=lambda matrix, g: matrix @ g), "solve with it"),
        (partial(step, solve=lambda matrix, g: torch.linalg.solve(matrix - 0.1 * torch.eye(4), g)), "damping is"),
        (partial(step, solve=lambda matrix, g: torch.linalg.solve(matrix + torch.eye(4), g)), "linalg.solve"),
        (partial(step, length=lambda x, matrix, d: 2 * d / (x @ matrix @ x)), "root is missing"),
        (partial(step, length=euclidean, allowed=lambda *_: True), "Euclidean"),
        (partial(step, length=lambda x, matrix, d: (2 * d / (x @ (matrix - 0.1 * torch.eye(4)) @ x)).sqrt()),
         "½ΔᵀFΔ is δ"),
        (partial(step, length=lambda x, matrix, d: 0.3 * (2 * d / (x @ matrix @ x)).sqrt()), "0.09 δ"),
        (partial(step, allowed=lambda kl, model, max_kl: kl <= max_kl and model > 0.9 * max_kl), "backtrack"),
        (partial(step, improved=lambda after, before: after > before + 0.06), "backtrack"),
        (lambda surrogate, mean_kl, theta, **numbers: theta.add_(0.001), "in place"),
        (lambda surrogate, mean_kl, theta, **numbers: theta / 0, "direction"),
        (lambda surrogate, mean_kl, theta, **numbers: theta[7], "IndexError"),
    ],
)  # fmt: skip
def test_known_mistakes_are_named(wrong: Callable, words: str) -> None:
    verdict = graders.trpo_step(wrong)
    assert verdict.passed is False
    assert words in verdict.message, verdict


def test_the_diagnosis_is_judged() -> None:
    numbered = dict(enumerate(BROKEN.values()))
    right = dict(enumerate(BROKEN))
    assert graders.diagnosis(right, numbered).passed is True
    assert graders.diagnosis(right | {3: ...}, numbered).passed is None
    assert "no check is called" in graders.diagnosis(right | {3: "luck"}, numbered).message
    assert "TRPO 3: it gets as far" in graders.diagnosis(right | {3: "refusal"}, numbered).message
    assert '"length" lets it pass' in graders.diagnosis(right | {3: "length"}, numbered).message


def fisher_blocks(features, log_scale, v_weight, v_log_scale, *, outer=None):
    second = np.mean([np.outer(phi, phi) for phi in features], axis=0) if outer is None else outer(features)
    return v_weight @ second / np.exp(2 * log_scale)[:, None], 2 * v_log_scale


def changed(weight=lambda w, ls: w, log=lambda s, ls: s, **options) -> Callable:
    def function(features, log_scale, v_weight, v_log_scale):
        first, second = fisher_blocks(features, log_scale, v_weight, v_log_scale, **options)
        return weight(first, log_scale), log(second, log_scale)

    return function


def test_the_linear_product_passes() -> None:
    assert graders.linear_fisher_product(fisher_blocks).passed is True
    assert graders.linear_fisher_product(lambda *_: ...).passed is None


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (changed(log=lambda s, ls: s / 2), "2, whatever σ is"),
        (changed(log=lambda s, ls: s / np.exp(2 * ls)), "that of σ"),
        (changed(weight=lambda w, ls: w * np.exp(ls)[:, None]), "not σ"),
        (changed(weight=lambda w, ls: w * np.exp(4 * ls)[:, None]), "*divided*"),
        (changed(outer=lambda phi: phi.T @ phi), "sum over states"),
        (changed(outer=lambda phi: np.diag((phi**2).mean(0))), "φφᵀ, not φ²"),
        (changed(outer=lambda phi: np.outer(phi.mean(0), phi.mean(0))), "outer products"),
        (changed(weight=lambda w, ls: 0 * w), "expected"),
    ],
)
def test_known_mistakes_of_the_linear_product_are_named(wrong: Callable, words: str) -> None:
    verdict = graders.linear_fisher_product(wrong)
    assert verdict.passed is False
    assert words in verdict.message
