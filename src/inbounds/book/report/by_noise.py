"""The second study's laws by the noise that they start with: is the order of two laws one of 0.4 alone?"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from inbounds.book.report import html
from inbounds.book.report.equal_start import with_second
from inbounds.book.report.html import Shown
from inbounds.book.report.words import graded
from inbounds.study.outcomes import Column, Outcomes
from inbounds.study.second import PAIRS, Pair, compared, pooled_difference
from inbounds.study.second.pooled import pooled_scores
from inbounds.study.statistics import Comparison, Estimate, mean_of
from inbounds.study.words import spoken, verdict

__all__ = ["LAWS", "NOISES", "ROBOTS", "against_gaussian", "by_noise", "change"]

LAWS: Mapping[str, str] = MappingProxyType(
    {"gaussian": "Gaussian", "beta": "Beta", "logit-normal": "logit-normal"}
)
"""Families, and their names in the table."""
NOISES = (0.2, 0.4, 0.55)
"""Executed noise before training, in units of half the range."""
ROBOTS = ("HalfCheetah", "Hopper", "Ant")
"""On which the other two are planned."""
NOT_RUN = "not run"
WORDS = {"higher": "above", "lower": "below", "unresolved": "no difference found"}
"""What the page calls a verdict."""


def _column(law: str, noise: float) -> Column:
    return Column("equal", "ppo", law) if noise == 0.4 else Column("noise", "ppo", law, f"noise-{noise:g}")


def _pair(law: str, noise: float) -> Pair:
    asked = "law, σ of the state" if noise == 0.4 else "other noise"
    (found,) = (pair for pair in PAIRS[asked] if pair.first == _column(law, noise))
    return found


def change(outcomes: Outcomes, law: str, noise: float, robot: str) -> Estimate | None:
    """Return the final return of a law that starts with a noise, minus that with 0.4; None where a cell is missing.

    Args:
        outcomes: of either study.
        law: a key of `LAWS`.
        noise: 0.2 or 0.55.
        robot: a robot of `ROBOTS`.
    """
    return pooled_difference(with_second(outcomes), _column(law, noise), _column(law, 0.4), robot, "final")


def against_gaussian(outcomes: Outcomes, law: str, noise: float, robot: str) -> Comparison:
    """Return the test of a law's final return minus the Gaussian's, both with a noise, its σ of the state.

    Holm's correction is over the robots on which the pair is planned, those that are not run included.

    Args:
        outcomes: of either study.
        law: beta or logit-normal.
        noise: one of `NOISES`.
        robot: a robot of `ROBOTS`.
    """
    return compared(with_second(outcomes), _pair(law, noise), "final")[robot]


def by_noise(outcomes: Outcomes) -> Shown:
    """Return a table: robot and noise, the final return of each law, and its difference from the Gaussian's.

    Args:
        outcomes: of either study.
    """
    both = with_second(outcomes)
    tests = {
        (law, noise): compared(both, _pair(law, noise), "final")
        for law in ("beta", "logit-normal")
        for noise in NOISES
    }
    rows = []
    for robot in ROBOTS:
        for noise in NOISES:
            returns = [_mean(both, _column(law, noise), robot) for law in LAWS]
            if all(found == NOT_RUN for found in returns):
                continue
            gaps = [_told(tests[law, noise][robot]) for law in ("beta", "logit-normal")]
            rows.append([robot, f"{noise:g}", *returns, *gaps])
    head = ["robot", "noise", *LAWS.values(), "Beta − Gaussian", "logit-normal − Gaussian"]
    caption = (
        "PPO, second study: final return by the noise that a law executes before training, with 95 % intervals; ten "
        "seeds, twenty for Beta and logit-normal at 0.4. The Gaussian's σ depends on the state."
    )
    lacking = [robot for robot in ROBOTS if all(row[:2] != [robot, "0.2"] for row in rows)]
    strip = [html.missing(f"Not run with other noise: {', '.join(lacking)}.")] if lacking else []
    return html.of_study("the laws by their first noise", html.table(caption, head, rows), *strip)


def _mean(outcomes: Outcomes, column: Column, robot: str) -> str:
    scores = pooled_scores(outcomes, column, robot, "final")
    return NOT_RUN if scores is None else spoken(mean_of(scores, missing="exclude"), 0)


def _told(found: Comparison) -> str:
    if found.difference is None:
        return NOT_RUN
    word = graded(verdict(found), found.difference)
    return f"{spoken(found.difference)}\n{WORDS.get(word, word)}"
