"""What every chapter's graders owe the reader: a right answer passes, and no answer is not a failure."""

import importlib
import inspect
import pkgutil
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from inbounds.book import exercises
from inbounds.book.exercises.judging import Judgement
from tests.book.exercises import (
    test_actions_have_bounds,
    test_advantages_of_actions,
    test_bang_bang,
    test_beta_policies,
    test_beta_spread_and_region,
    test_clipped_divergence,
    test_details_of_ppo,
    test_details_of_trpo,
    test_digits_of_a_beta,
    test_f_divergences,
    test_greedy_action,
    test_kl_invariance,
    test_logit_normal_density,
    test_logit_normal_moments,
    test_many_steps_from_one_batch,
    test_other_libraries,
    test_policy_that_learns,
    test_six_untrained_robots,
    test_storing_actions,
    test_symptoms_and_causes,
    test_tanh_gaussian,
    test_three_centres,
    test_trpo,
    test_update_without_autograd,
    test_when_does_the_law_matter,
)

NOTEBOOKS = Path(__file__).resolve().parents[3] / "notebooks"
CHAPTERS = {
    path.stem: re.findall(
        r"from inbounds\.book\.exercises import (\w+) as graders", path.read_text(encoding="utf8")
    )
    for path in NOTEBOOKS.glob("*.ipynb")
}
RIGHT = [
    pytest.param(getattr(importlib.import_module(f"{exercises.__name__}.{chapter}"), name), right, id=name)
    for chapter, answers in {
        "actions_have_bounds": test_actions_have_bounds.RIGHT,
        "advantages_of_actions": test_advantages_of_actions.RIGHT,
        "many_steps_from_one_batch": test_many_steps_from_one_batch.RIGHT,
        "bang_bang": test_bang_bang.RIGHT,
        "beta_policies": test_beta_policies.RIGHT,
        "beta_spread_and_region": test_beta_spread_and_region.RIGHT,
        "clipped_divergence": test_clipped_divergence.RIGHT,
        "details_of_ppo": test_details_of_ppo.RIGHT,
        "details_of_trpo": test_details_of_trpo.RIGHT,
        "digits_of_a_beta": test_digits_of_a_beta.RIGHT,
        "f_divergences": test_f_divergences.RIGHT,
        "greedy_action": test_greedy_action.RIGHT,
        "kl_invariance": test_kl_invariance.RIGHT,
        "logit_normal_density": test_logit_normal_density.RIGHT,
        "logit_normal_moments": test_logit_normal_moments.RIGHT,
        "other_libraries": test_other_libraries.RIGHT,
        "six_untrained_robots": test_six_untrained_robots.RIGHT,
        "symptoms_and_causes": test_symptoms_and_causes.RIGHT,
        "tanh_gaussian": test_tanh_gaussian.RIGHT,
        "update_without_autograd": test_update_without_autograd.RIGHT,
        "policy_that_learns": test_policy_that_learns.RIGHT,
        "storing_actions": test_storing_actions.RIGHT,
        "three_centres": test_three_centres.RIGHT,
        "trpo": test_trpo.RIGHT,
        "when_does_the_law_matter": test_when_does_the_law_matter.RIGHT,
    }.items()
    for name, right in answers.items()
]
GRADERS = [
    grader
    for module in pkgutil.iter_modules(exercises.__path__, f"{exercises.__name__}.")
    for name, grader in inspect.getmembers(importlib.import_module(module.name), inspect.isfunction)
    if grader.__module__ == module.name and not name.startswith("_")
    if list(inspect.signature(grader).parameters) in (["function"], ["make"])
    if "Judgement" in str(inspect.signature(grader).return_annotation)
]


def test_a_chapter_s_graders_have_its_name() -> None:
    graded = {chapter for chapter, modules in CHAPTERS.items() if modules}
    assert all(CHAPTERS[chapter] == [chapter] for chapter in graded)
    assert {module.name for module in pkgutil.iter_modules(exercises.__path__)} == graded | {
        "judging",
        "checks",
    }
    assert {grader.__module__.rpartition(".")[2] for grader in GRADERS} == graded


@pytest.mark.parametrize(("grader", "right"), RIGHT)
def test_right_answers_pass(grader: Callable, right: Callable) -> None:
    verdict = grader(right)
    assert verdict.passed is True, verdict


@pytest.mark.parametrize("grader", GRADERS, ids=lambda grader: grader.__name__)
def test_an_unanswered_exercise_is_not_a_failure(grader: Callable) -> None:
    assert grader(lambda *_, **__: ...).passed is None


@pytest.mark.parametrize("grader", GRADERS, ids=lambda grader: grader.__name__)
def test_an_exception_is_reported(grader: Callable) -> None:
    verdict = grader(lambda *_, **__: 1 / 0)
    assert verdict.passed is False
    assert "ZeroDivisionError" in verdict.message


def test_all_graders_are_found() -> None:
    chapters = [path for path in Path(exercises.__file__).parent.glob("*.py") if path.stem in CHAPTERS]
    written = {
        (path.stem, name)
        for path in chapters
        for name in re.findall(
            r"^def ([a-z]\w*)\(\s*(?:function|make): [^)]*?\) -> Judgement", path.read_text("utf8"), re.M
        )
    }
    assert {(grader.__module__.rpartition(".")[2], grader.__name__) for grader in GRADERS} == written


@pytest.mark.parametrize("grader", GRADERS, ids=lambda grader: grader.__name__)
@pytest.mark.parametrize(
    "pack", [lambda x: x, lambda x: (x, x), lambda x: [x, [x]]], ids=["one", "two", "nested"]
)
def test_an_answer_with_a_graph_is_judged_like_any_other(grader: Callable, pack: Callable) -> None:
    """The most common answer of all: a tensor that requires a gradient."""
    verdict = grader(lambda *_, **__: pack(torch.ones(1, dtype=torch.float64, requires_grad=True)))
    assert isinstance(verdict, Judgement)
    assert "requires grad" not in verdict.message


def with_a_graph(answer: Any) -> Any:
    if isinstance(answer, tuple):
        return tuple(map(with_a_graph, answer))
    if answer is None or isinstance(answer, torch.Tensor):
        return answer if answer is None else answer.detach().requires_grad_()
    return torch.tensor(np.asarray(answer), requires_grad=True)


@pytest.mark.parametrize(
    ("grader", "right"),
    RIGHT,
)
def test_a_right_answer_with_a_graph_passes(grader: Callable, right: Callable) -> None:
    verdict = grader(lambda *arguments: with_a_graph(right(*arguments)))
    assert verdict.passed is True, verdict
