"""The graders of *TRPO* pass a step found by dense algebra, and name each of five planted bugs."""

from collections.abc import Callable
from functools import partial
from typing import Any

import pytest
import torch
from torch.distributions import kl_divergence
from torch.nn.utils import parameters_to_vector, vector_to_parameters

from inbounds.book.exercises import trpo as graders
from inbounds.book.exercises.checks.trpo import CHECKS
from tests.book.exercises.test_ppo import right_advantages


def dense(
    gain: Callable, mean_kl: Callable, weights: list, damping: float
) -> tuple[torch.Tensor, torch.Tensor]:
    """Damped Hessian of the divergence, row by row, and the surrogate's gradient."""
    gradient = parameters_to_vector(torch.autograd.grad(gain(), weights))
    slope = parameters_to_vector(torch.autograd.grad(mean_kl(), weights, create_graph=True))
    rows = [parameters_to_vector(torch.autograd.grad(each, weights, retain_graph=True)) for each in slope]
    return torch.stack(rows) + damping * torch.eye(len(gradient), dtype=gradient.dtype), gradient


def step(
    gain: Callable,
    mean_kl: Callable,
    weights: list,
    max_kl: float,
    damping: float,
    *,
    solve: Callable = torch.linalg.solve,
    length: Callable = lambda x, matrix, max_kl: (2 * max_kl / (x @ matrix @ x)).sqrt(),
    allowed: Callable = lambda kl, model, max_kl: kl <= max_kl,
    improved: Callable = lambda after, before: after > before,
    give_up: bool = True,
    full: torch.Tensor | None = None,
) -> None:
    """The right step, by a dense Hessian and a dense solver, with a place for every bug."""
    matrix, gradient = dense(gain, mean_kl, weights, damping)
    x = solve(matrix, gradient)
    full = length(x, matrix, max_kl) * x if full is None else full
    with torch.no_grad():
        theta, before = parameters_to_vector(weights).clone(), gain()
        for k in range(10):
            delta = 0.5**k * full
            vector_to_parameters(theta + delta, weights)
            within = allowed(mean_kl(), delta @ matrix @ delta / 2, max_kl)
            if within and improved(gain(), before):
                return
        if give_up:
            vector_to_parameters(theta, weights)


BROKEN = {
    "direction": partial(step, solve=lambda matrix, g: matrix @ g),
    "length": partial(step, length=lambda x, matrix, max_kl: (max_kl / (x @ matrix @ x)).sqrt()),
    "trust": partial(step, allowed=lambda kl, model, max_kl: model <= max_kl * (1 + 1e-9)),
    "improvement": partial(step, improved=lambda after, before: True),
    "refusal": partial(step, give_up=False),
}


def test_a_right_step_passes() -> None:
    verdict = graders.trpo_step(step)
    assert verdict.passed is True, verdict


def test_a_line_search_that_forgives_a_half_is_seen() -> None:
    verdict = graders.trpo_step(partial(step, allowed=lambda kl, model, max_kl: kl <= 1.5 * max_kl))
    assert verdict.passed is False
    assert 'check "trust": the exact KL divergence is 1.3 max_kl' in verdict.message


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
         "½ΔᵀFΔ is max_kl"),
        (partial(step, length=lambda x, matrix, d: 0.3 * (2 * d / (x @ matrix @ x)).sqrt()), "0.09 max_kl"),
        (partial(step, allowed=lambda kl, model, max_kl: kl <= max_kl and model > 0.9 * max_kl), "backtrack"),
        (partial(step, improved=lambda after, before: after > before + 0.06), "backtrack"),
        (lambda gain, mean_kl, weights, **numbers: None, "does not move"),
        (lambda gain, mean_kl, weights, **numbers: weights[7], "IndexError"),
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


def walk(beta: Callable = lambda new, old: new / old, stop: float = 1e-20, slip: str = "") -> Callable:
    def conjugate_gradient(product, b, iterations=10):
        x, residual, direction = torch.zeros_like(b), b, b
        for _ in range(iterations):
            square = residual @ residual
            if square < stop:
                break
            image = product(direction)
            x = x + square / (direction @ image) * direction
            length = square / (direction @ image)
            residual = residual - length * (direction if slip == "direction" else image)
            weight = length if slip == "length" else beta(residual @ residual, square)
            direction = residual + weight * direction
        return x

    return conjugate_gradient


def in_place(product, b, iterations):
    x, residual, direction = torch.zeros_like(b), b, b
    for _ in range(iterations):
        image, square = product(direction), residual @ residual
        length = square / (direction @ image)
        x += length * direction
        residual -= length * image
        direction = residual + (residual @ residual / square) * direction
    return x


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda product, b, iterations: b, "b itself"),
        (walk(beta=lambda new, old: 0), "steepest descent"),
        (walk(beta=lambda new, old: 1), "β is 1"),
        (walk(beta=lambda new, old: old / new), "upside down"),
        (walk(slip="length"), "not by the step's length"),
        (walk(slip="direction"), "not the direction"),
        (lambda product, b, iterations: walk()(product, b, 2), "iterations is not used"),
        (lambda product, b, iterations: walk()(product, -b, iterations), "solves for −b"),
        (lambda product, b, iterations: b - product(walk()(product, b, iterations)), "the residual"),
        (walk(stop=-1.0), "divides 0 by 0"),
        (lambda product, b, iterations: 2 * b, "nearest to the solution"),
        (in_place, "b itself was changed"),
    ],
)
def test_known_mistakes_of_the_solver_are_named(wrong: Callable, words: str) -> None:
    verdict = graders.conjugate_gradient(wrong)
    assert verdict.passed is False
    assert words in verdict.message


def right_natural_step(gain, mean_kl, weights, max_kl, damping=0.1, *, shape=None):
    matrix, b = dense(gain, mean_kl, weights, damping)
    x = torch.linalg.solve(matrix, b)
    return (2 * max_kl / (x @ matrix @ x)).sqrt() * x if shape is None else shape(matrix, b, x, max_kl)


@pytest.mark.parametrize(
    ("shape", "words"),
    [
        (lambda m, b, x, d: (d / (x @ b)).sqrt() * x, "2 under the root"),
        (lambda m, b, x, d: 2 * d / (x @ b) * x, "root is missing"),
        (lambda m, b, x, d: x, "that is x"),
        (lambda m, b, x, d: (2 * d / (x @ x)).sqrt() * x, "Euclidean"),
        (lambda m, b, x, d: -((2 * d / (x @ b)).sqrt()) * x, "downhill"),
        (lambda m, b, x, d: (2 * d / (x @ (m @ x - 0.1 * x))).sqrt() * x, "damped product"),
        (lambda m, b, x, d: (2 * d / (b @ m @ b)).sqrt() * b, "plain gradient"),
        (lambda m, b, x, d: 3 * x, "do not both hold"),
    ],
)
def test_known_mistakes_of_the_natural_step_are_named(shape: Callable, words: str) -> None:
    verdict = graders.natural_step(lambda *given: right_natural_step(*given, shape=shape))
    assert verdict.passed is False
    assert words in verdict.message


def test_a_natural_step_leaves_the_weights_alone() -> None:
    def hasty(gain, mean_kl, weights, max_kl, damping):
        full = right_natural_step(gain, mean_kl, weights, max_kl, damping)
        vector_to_parameters(parameters_to_vector(weights) + full, weights)
        return full

    assert "line search's business" in graders.natural_step(hasty).message


def right_line_search(gain, mean_kl, weights, full, max_kl, **flaws):
    return step(gain, mean_kl, weights, max_kl, 0.1, full=full, **flaws)


@pytest.mark.parametrize(
    ("flaws", "check"),
    [
        ({"allowed": lambda kl, model, max_kl: kl <= max_kl / 3}, "length"),
        ({"allowed": lambda kl, model, max_kl: True}, "trust"),
        ({"improved": lambda after, before: True}, "improvement"),
        ({"give_up": False}, "refusal"),
    ],
)
def test_known_mistakes_of_the_line_search_are_named(flaws: dict[str, Any], check: str) -> None:
    assert graders.line_search(right_line_search).passed is True
    verdict = graders.line_search(partial(right_line_search, **flaws))
    assert verdict.passed is False
    assert f'check "{check}"' in verdict.message


@pytest.mark.parametrize(
    ("improved", "words"),
    [
        (lambda after, before: after >= before, "> and not >="),
        (lambda after, before: after > 0, "not with 0"),
    ],
)
def test_a_line_search_must_see_a_larger_surrogate(improved: Callable, words: str) -> None:
    verdict = graders.line_search(partial(right_line_search, improved=improved))
    assert verdict.passed is False
    assert verdict.message.startswith('check "improvement"')
    assert words in verdict.message
    assert words in graders.trpo_step(partial(step, improved=improved)).message


def test_halves_added_to_moved_weights_are_named() -> None:
    @torch.no_grad()
    def an_alias(gain, mean_kl, weights, full, max_kl):
        old, before = list(weights), gain()
        for k in range(10):
            vector_to_parameters(parameters_to_vector(old) + 0.5**k * full, weights)
            if mean_kl() <= max_kl and gain() > before:
                return

    verdict = graders.line_search(an_alias)
    assert verdict.passed is False
    assert "list(weights) is none" in verdict.message


def right_surrogate(policy, batch, advantage, old_log_prob):
    log_ratio = policy.log_prob(batch.obs, batch.latent) - old_log_prob
    return (torch.exp(log_ratio) * advantage).mean()


RIGHT = {
    "conjugate_gradient": walk(),
    "natural_step": right_natural_step,
}


def update(policy, critic, adam, batch, max_kl, passes, size, *, flaw=""):
    """By dense algebra; its advantages are those of the test beside it."""
    advantage, to_go = right_advantages(batch, critic)
    old, old_outputs = policy.log_prob(batch.obs, batch.latent).detach(), policy.net(batch.obs).detach()
    if flaw == "own density":
        old = policy.log_prob(batch.obs, batch.latent)
    if flaw == "swapped":
        advantage, to_go = to_go, advantage
    if flaw != "raw":
        advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-8)

    def gain():
        return right_surrogate(policy, batch, advantage, old)

    def mean_kl():
        laws = policy.law(old_outputs), policy.law(policy.net(batch.obs))
        each = kl_divergence(*laws[:: -1 if flaw == "turned round" else 1]).sum(-1)
        return each if flaw == "no mean" else each.mean()

    weights = list(policy.net.parameters())
    if flaw != "lazy":
        full = exact_iterate(gain, mean_kl, weights, max_kl)
        step(gain, mean_kl, weights, max_kl, 0.1, full=full)
    for _ in range(0 if flaw == "no critic" else passes):
        for index in torch.randperm(len(old)).split(size):
            adam.zero_grad()
            target = advantage if flaw == "wrong target" else to_go
            (critic(batch.obs[index]) - target[index]).square().mean().backward()
            torch.nn.utils.clip_grad_norm_(list(critic.parameters()), 0.5)
            adam.step()


def exact_iterate(gain, mean_kl, weights, max_kl):
    matrix, b = dense(gain, mean_kl, weights, 0.1)
    x = walk()(lambda v: matrix @ v, b, 10).detach()
    return (2 * max_kl / (x @ matrix @ x)).sqrt().detach() * x


@pytest.mark.parametrize(
    ("flaw", "words"),
    [
        ("raw", "the policy ends elsewhere"),
        ("lazy", "policy has not moved"),
        ("no critic", "critic has not learned"),
        ("wrong target", "the policy is right; the critic"),
        ("swapped", "*first* of the two that `advantages` returns"),
        ("own density", ".detach() the old log-probabilities"),
        ("no mean", "a .mean() is missing"),
        ("turned round", "mean_kl() is KL(old‖new)"),
    ],
)
def test_an_update_is_judged_by_both_networks(flaw: str, words: str) -> None:
    verdict = graders.update(update)
    assert verdict.passed is True, verdict
    verdict = graders.update(partial(update, flaw=flaw))
    assert verdict.passed is False
    assert words in verdict.message
