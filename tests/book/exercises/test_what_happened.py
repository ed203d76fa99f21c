"""The graders of *What happened* pass right answers, and name the known mistakes."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy import stats

from inbounds.book.exercises import what_happened as graders
from inbounds.study.statistics import holm


def sheet(gaps: np.ndarray, p_values: np.ndarray) -> list[int]:
    clear = holm(p_values) < 0.05
    return [int((clear & (gaps > 0)).sum()), int((~clear).sum()), int((clear & (gaps < 0)).sum())]


def student(returns: np.ndarray) -> np.ndarray:
    low, high = stats.t.interval(0.95, len(returns) - 1, 0, stats.sem(returns, axis=0))
    return (high - low) / 2


def uncorrected(gaps: np.ndarray, p_values: np.ndarray) -> list[int]:
    clear = p_values < 0.05
    return [int((clear & (gaps > 0)).sum()), int((~clear).sum()), int((clear & (gaps < 0)).sum())]


def bonferroni(gaps: np.ndarray, p_values: np.ndarray) -> list[int]:
    return uncorrected(gaps, p_values * len(p_values))


def never_stops(gaps: np.ndarray, p_values: np.ndarray) -> list[int]:
    steps = np.empty(len(gaps))
    steps[np.argsort(p_values, kind="stable")] = np.arange(len(gaps), 0, -1)
    return uncorrected(gaps, p_values * steps)


@pytest.mark.parametrize(("grader", "right"), [(graders.score_sheet, sheet), (graders.half_width, student)])
def test_right_answers_pass(grader: Callable, right: Callable) -> None:
    assert grader(right).passed is True, grader(right)
    assert grader(lambda *_: ...).passed is None


@pytest.mark.parametrize(
    ("grader", "wrong", "words"),
    [
        (graders.score_sheet, uncorrected, "correct them for their number"),
        (graders.score_sheet, bonferroni, "Bonferroni"),
        (graders.score_sheet, never_stops, "once one is not rejected"),
        (graders.score_sheet, lambda g, p: sheet(-g, p), "changed places"),
        (graders.score_sheet, lambda g, p: sheet(g, p)[:2], "(wins, ties, losses)"),
        (graders.half_width, lambda r: 1.96 * r.std(0) / np.sqrt(r.size), "all three errors"),
        (
            graders.half_width,
            lambda r: 1.96 * r.std(0, ddof=1) / np.sqrt(len(r)),
            "so few seeds need Student's t",
        ),
        (
            graders.half_width,
            lambda r: 1.96 * stats.sem(r, axis=0) * (len(r) / r.size) ** 0.5,
            "two errors",
        ),
        (graders.half_width, lambda r: student(r) * 5, "one number per epoch"),
        (graders.half_width, lambda r: student(r) * np.sqrt(len(r)), "single seed"),
        (graders.half_width, lambda r: 2.262157 * stats.sem(r, axis=0), "any number of seeds"),
    ],
)
def test_known_mistakes_are_named(grader: Callable, wrong: Callable, words: str) -> None:
    verdict = grader(wrong)
    assert verdict.passed is False
    assert words in verdict.message, verdict
