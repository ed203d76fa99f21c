"""What every chapter's graders owe the reader: a right answer passes, and no answer is not a failure."""

from collections.abc import Callable

import pytest

from inbounds.book import graders, graders_beta, graders_greedy, graders_invariance
from tests.book import test_graders, test_graders_beta, test_graders_greedy, test_graders_invariance

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
