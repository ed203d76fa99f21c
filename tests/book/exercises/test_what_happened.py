"""The graders of *What happened* pass right answers, and name the known mistakes."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy import stats

from inbounds.book.exercises import what_happened as graders
from inbounds.study.statistics import holm, interquartile_mean


def sheet(gaps: np.ndarray, p_values: np.ndarray) -> list[int]:
    clear = holm(p_values) < 0.05
    return [int((clear & (gaps > 0)).sum()), int((~clear).sum()), int((clear & (gaps < 0)).sum())]


def interquartile(final: np.ndarray, idle: np.ndarray) -> np.ndarray:
    best = final.mean(axis=2).max(axis=0)
    scaled = (final - idle[:, None]) / (best - idle)[:, None]
    return interquartile_mean(scaled.reshape(len(final), -1))


def as_printed(final: np.ndarray, idle: np.ndarray) -> np.ndarray:
    best = final.max(axis=(0, 2))
    scaled = (final - idle[:, None]) / best[:, None]
    return stats.trim_mean(scaled, 0.25, axis=2).mean(axis=1)


def luckiest(final: np.ndarray, idle: np.ndarray) -> np.ndarray:
    scaled = (final - idle[:, None]) / (final.max(axis=(0, 2)) - idle)[:, None]
    return interquartile_mean(scaled.reshape(len(final), -1))


def uncorrected(gaps: np.ndarray, p_values: np.ndarray) -> list[int]:
    clear = p_values < 0.05
    return [int((clear & (gaps > 0)).sum()), int((~clear).sum()), int((clear & (gaps < 0)).sum())]


def bonferroni(gaps: np.ndarray, p_values: np.ndarray) -> list[int]:
    return uncorrected(gaps, p_values * len(p_values))


def never_stops(gaps: np.ndarray, p_values: np.ndarray) -> list[int]:
    steps = np.empty(len(gaps))
    steps[np.argsort(p_values, kind="stable")] = np.arange(len(gaps), 0, -1)
    return uncorrected(gaps, p_values * steps)


@pytest.mark.parametrize(("grader", "right"), [(graders.score_sheet, sheet), (graders.scores, interquartile)])
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
        (graders.scores, as_printed, "luckiest run; the unit is the way from doing nothing"),
        (graders.scores, luckiest, "1 belongs to the highest mean"),
        (graders.scores, lambda f, i: interquartile(f, i)[:1], "`[C]`"),
        (
            graders.scores,
            lambda f, i: stats.trim_mean((f - i[:, None]).reshape(3, -1), 0.25, axis=1),
            "`[C]`",
        ),
    ],
)
def test_known_mistakes_are_named(grader: Callable, wrong: Callable, words: str) -> None:
    verdict = grader(wrong)
    assert verdict.passed is False
    assert words in verdict.message, verdict
