"""How any exercise is judged: no answer is not a failure, an exception is reported, a verdict shows itself."""

from collections.abc import Callable

import numpy as np
import pytest
import torch

from inbounds.book.exercises.judging import Case, Judgement, judge_cases, judge_diagnosis

SQUARE = [Case((3.0,), 9.0, {"that is the double": 6.0})]


@pytest.mark.parametrize("empty", [None, NotImplemented, ...])
def test_a_function_that_returns_nothing_is_unanswered(empty: object) -> None:
    assert judge_cases(lambda x: empty, SQUARE, "right").passed is None


def test_right_known_and_unknown_mistakes() -> None:
    assert judge_cases(lambda x: x * x, SQUARE, "right").passed is True
    assert judge_cases(lambda x: 2 * x, SQUARE, "right").message == "that is the double"
    assert judge_cases(lambda x: x, SQUARE, "right").message == "the value is wrong: expected 9, got 3"


def test_a_number_in_a_list_is_told_its_shape() -> None:
    verdict = judge_cases(lambda x: [x * x], SQUARE, "right")
    assert verdict.passed is False
    assert verdict.message == "the value is wrong: the number is to have the shape [], got [1]"


@pytest.mark.parametrize("kind", [np.array, torch.tensor])
def test_an_argument_is_to_stay_as_it_was(kind: Callable) -> None:
    def doubled(x, work):
        work *= 2
        return work

    case = Case((kind([1.0, np.nan]), kind([1.0, 2.0])), [2.0, 4.0], {})
    verdict = judge_cases(doubled, [case], "right")
    assert verdict.passed is False
    assert "changes an array that it was given" in verdict.message
    case = Case((kind([1.0, np.nan]), kind([1.0, 2.0])), [2.0, 4.0], {})
    assert judge_cases(lambda x, work: 2 * work, [case], "right").passed is True


def test_an_exception_is_reported() -> None:
    verdict = judge_cases(lambda x: x / 0, SQUARE, "right")
    assert verdict.passed is False
    assert "ZeroDivisionError" in verdict.message


def test_a_verdict_shows_itself() -> None:
    verdict = Judgement("f", False, "a < b")
    assert repr(verdict) == "✗ not yet: f: a < b"
    assert "a &lt; b" in verdict._repr_html_()


@pytest.mark.parametrize(("book", "told"), [("1", "✓ passed, by the book"), ("0", "✓ passed<")])
def test_a_page_says_whose_answer_has_passed(book: str, told: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("INBOUNDS_BOOK_BUILD", book)
    assert told in Judgement("f", True, "right")._repr_html_()
    assert "by the book" not in Judgement("f", False, "wrong")._repr_html_()


def test_a_diagnosis_that_is_no_name_is_judged_all_the_same() -> None:
    checks = {"sign": lambda f: "" if f(-1) < 0 else "it loses the sign"}
    found = judge_diagnosis({"A": ["sign"]}, {"A": abs}, checks, "function", "earlier", "later")
    assert found.passed is False
    assert found.message == "no check is called ['sign']; there are sign"
