"""The graders of the comparison chapter pass the right answers and name the known mistakes."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy import stats

from inbounds.book.exercises import how_to_compare_ten_seeds as graders
from inbounds.study.statistics import holm


def student(curves):
    result = curves[:, -(curves.shape[1] // 10) :].mean(1)
    return stats.ttest_1samp(result, 0).confidence_interval(0.95)  # an independent road


def test_right_answers_pass() -> None:
    assert graders.adjust(holm).passed is True
    assert graders.final_interval(student).passed is True


def test_unanswered_exercises_are_no_failures() -> None:
    assert graders.adjust(lambda *_: ...).passed is None
    assert graders.final_interval(lambda *_: ...).passed is None


def falling(p):
    order = np.argsort(p)
    adjusted = np.empty(len(p))
    adjusted[order] = np.minimum(p[order] * np.arange(len(p), 0, -1), 1)
    return adjusted


def uncapped(p):
    order = np.argsort(p)
    adjusted = np.empty(len(p))
    adjusted[order] = np.maximum.accumulate(p[order] * np.arange(len(p), 0, -1))
    return adjusted


def lenient(p):
    made = ~np.isnan(p)
    adjusted = np.full(len(p), np.nan)
    adjusted[made] = holm(p[made])
    return adjusted


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda p: np.minimum(len(p) * p, 1), "Bonferroni"),
        (falling, "running maximum"),
        (lambda p: np.sort(holm(p)), "in the order given"),
        (uncapped, "cap it"),
        (lenient, "keep its place"),
        (lambda p: np.minimum(p * (1 + np.argsort(np.argsort(p))), 1), "downwards"),
        (stats.false_discovery_control, "Benjamini"),
        (lambda p: holm(p) / 2, "the value is wrong"),
    ],
)
def test_holm_mistakes(wrong: Callable, words: str) -> None:
    verdict = graders.adjust(wrong)
    assert verdict.passed is False
    assert words in verdict.message


def printed(curves):
    """The exercise as it is printed, all errors included."""
    tail = curves[:, -len(curves[0]) // 10 :].ravel()
    reach = 1.96 * tail.std() / np.sqrt(len(tail))
    return tail.mean() - reach, tail.mean() + reach


def with_results(curves, ddof, quantile, root=True):
    result = curves[:, -(curves.shape[1] // 10) :].mean(1)
    reach = quantile * result.std(ddof=ddof) / (np.sqrt(len(result)) if root else 1)
    return result.mean() - reach, result.mean() + reach


def t(curves):
    return stats.t.ppf(0.975, len(curves) - 1)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (printed, "all three"),
        (lambda c: with_results(c, 0, 1.96), "two errors are left"),
        (lambda c: with_results(c, 1, 1.96), "Student's is wanted"),
        (lambda c: with_results(c, 0, t(c)), "ddof"),
        (lambda c: with_results(c, 1, t(c), root=False), "divide by √n"),
        (lambda c: with_results(c, 1, stats.t.ppf(0.975, len(c))), "not n"),
        (lambda c: with_results(c, 1, stats.t.ppf(0.95, len(c) - 1)), "97.5 %"),
        (lambda c: stats.ttest_1samp(c[:, -1], 0).confidence_interval(), "only the last epoch"),
        (lambda c: stats.ttest_1samp(c.mean(1), 0).confidence_interval(), "all epochs are used"),
        (
            lambda c: stats.ttest_1samp(c[:, -(c.shape[1] // 10) :].ravel(), 0).confidence_interval(),
            "within a seed first",
        ),
        (lambda c: np.add(student(c), 1), "the interval is wrong"),
    ],
)
def test_interval_mistakes(wrong: Callable, words: str) -> None:
    verdict = graders.final_interval(wrong)
    assert verdict.passed is False
    assert words in verdict.message
