"""What every chapter's graders owe the reader: a right answer passes, and no answer is not a failure."""

import importlib
import inspect
import pkgutil
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import torch

import inbounds.book
from inbounds.book import graders, graders_beta, graders_greedy, graders_invariance, graders_trpo
from tests.book import (
    test_graders,
    test_graders_beta,
    test_graders_greedy,
    test_graders_invariance,
    test_graders_trpo,
)

EXERCISES = [
    pytest.param(getattr(module, name), right, id=name)
    for module, answers in {
        graders: test_graders.RIGHT,
        graders_beta: test_graders_beta.RIGHT,
        graders_greedy: test_graders_greedy.RIGHT,
        graders_invariance: test_graders_invariance.RIGHT,
    }.items()
    for name, right in answers.items()
]


@pytest.mark.parametrize(("grader", "right"), EXERCISES)
def test_right_answers_pass(grader: Callable, right: Callable) -> None:
    verdict = grader(right)
    assert verdict.passed is True, verdict


@pytest.mark.parametrize(("grader", "right"), EXERCISES)
def test_an_unanswered_exercise_is_not_a_failure(grader: Callable, right: Callable) -> None:
    assert grader(lambda *_: ...).passed is None


GRADERS = [
    grader
    for module in pkgutil.iter_modules(inbounds.book.__path__, "inbounds.book.")
    if module.name.startswith("inbounds.book.graders")
    for name, grader in inspect.getmembers(importlib.import_module(module.name), inspect.isfunction)
    if grader.__module__ == module.name and not name.startswith("_")
    if list(inspect.signature(grader).parameters) in (["function"], ["make"])
    if "Verdict" in str(inspect.signature(grader).return_annotation)
]


def test_all_graders_are_found() -> None:
    assert len(GRADERS) >= 29


@pytest.mark.parametrize("grader", GRADERS, ids=lambda grader: grader.__name__)
@pytest.mark.parametrize(
    "pack", [lambda x: x, lambda x: (x, x), lambda x: [x, [x]]], ids=["one", "two", "nested"]
)
def test_an_answer_with_a_graph_is_judged_like_any_other(grader: Callable, pack: Callable) -> None:
    """The most common answer of all: a tensor that requires a gradient."""
    verdict = grader(lambda *_, **__: pack(torch.ones(1, dtype=torch.float64, requires_grad=True)))
    assert isinstance(verdict, graders.Verdict)
    assert "requires grad" not in verdict.message


def with_a_graph(answer: Any) -> Any:
    if isinstance(answer, tuple):
        return tuple(map(with_a_graph, answer))
    if answer is None or isinstance(answer, torch.Tensor):
        return answer if answer is None else answer.detach().requires_grad_()
    return torch.tensor(np.asarray(answer), requires_grad=True)


@pytest.mark.parametrize(
    ("grader", "right"),
    [*EXERCISES, (graders_trpo.linear_fisher_product, test_graders_trpo.fisher_blocks)],
)
def test_a_right_answer_with_a_graph_passes(grader: Callable, right: Callable) -> None:
    verdict = grader(lambda *arguments: with_a_graph(right(*arguments)))
    assert verdict.passed is True, verdict
