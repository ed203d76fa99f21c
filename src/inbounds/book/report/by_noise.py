"""The second study's laws by the noise that they start with: is the order of two laws one of 0.4 alone?"""

from __future__ import annotations

from inbounds.book.report import html
from inbounds.book.report.equal_start import with_second
from inbounds.book.report.html import Shown
from inbounds.book.report.ways_to_act import BOUNDED
from inbounds.book.report.words import graded
from inbounds.study.outcomes import Column, Outcomes
from inbounds.study.second import PAIRS, Pair, compared, pooled_difference
from inbounds.study.statistics import Comparison, Estimate
from inbounds.study.words import spoken, verdict

__all__ = ["BOUNDED", "NOISES", "ROBOTS", "against_gaussian", "by_noise", "change", "column", "told"]

NOISES = (0.2, 0.4, 0.55)
"""Executed noise before training, in units of half the range."""
ROBOTS = PAIRS["other noise"][0].robots
"""On which other noise than 0.4 is planned."""
WORDS = {"higher": "above", "lower": "below", "unresolved": "no difference found"}
"""What the page calls a verdict."""


def column(law: str, noise: float) -> Column:
    """Return the second study's column of a law that starts with a noise, its σ of the state.

    Args:
        law: gaussian, beta or logit-normal.
        noise: one of `NOISES`.
    """
    return Column("equal", "ppo", law) if noise == 0.4 else Column("noise", "ppo", law, f"noise-{noise:g}")


def _pair(law: str, noise: float) -> Pair:
    asked = "law, σ of the state" if noise == 0.4 else "other noise"
    (found,) = (pair for pair in PAIRS[asked] if pair.first == column(law, noise))
    return found


def change(outcomes: Outcomes, law: str, noise: float, robot: str) -> Estimate | None:
    """Return the final return of a law that starts with a noise, minus that with 0.4; None where a cell is missing.

    Args:
        outcomes: of either study.
        law: gaussian, beta or logit-normal.
        noise: 0.2 or 0.55.
        robot: a robot of `ROBOTS`.
    """
    return pooled_difference(with_second(outcomes), column(law, noise), column(law, 0.4), robot, "final")


def against_gaussian(outcomes: Outcomes, law: str, noise: float) -> dict[str, Comparison]:
    """Return the tests of a law's final return minus the Gaussian's, both with a noise, its σ of the state, by robot.

    Holm's correction is over the robots on which the pair is planned, those that are not run included.

    Args:
        outcomes: of either study.
        law: beta or logit-normal.
        noise: one of `NOISES`.
    """
    return compared(with_second(outcomes), _pair(law, noise), "final")


def by_noise(outcomes: Outcomes) -> Shown:
    """Return a table: by robot and noise, the final return of each bounded law minus the Gaussian's.

    Args:
        outcomes: of either study.
    """
    tests = {(law, noise): against_gaussian(outcomes, law, noise) for law in BOUNDED for noise in NOISES}
    rows, lacking = [], []
    for robot in ROBOTS:
        found = {noise: [tests[law, noise][robot] for law in BOUNDED] for noise in NOISES}
        rows += [
            [f"{robot}, {noise:g}", *map(told, here)]
            for noise, here in found.items()
            if any(test.difference is not None for test in here)
        ]
        missing = [f"{noise:g}" for noise, here in found.items() if any(t.difference is None for t in here)]
        lacking += [f"{robot} with {' and '.join(missing)}"] if missing else []
    head = ["robot, noise", *(f"{name} − Gaussian" for name in BOUNDED.values())]
    caption = (
        "PPO, second study: difference of final returns, by the noise that both laws execute before training. The "
        "Gaussian's σ depends on the state. Ten seeds; twenty of Beta and logit-normal with 0.4."
    )
    strip = [html.missing(f"Not run, or not whole: {', '.join(lacking)}.")] if lacking else []
    return html.of_study("the laws by their first noise", html.table(caption, head, rows), *strip)


def told(found: Comparison) -> str:
    """Return a test's difference and, below it, its verdict; "not run" where a cell is missing."""
    if found.difference is None:
        return "not run"
    word = graded(verdict(found), found.difference)
    return f"{spoken(found.difference)}\n{WORDS.get(word, word)}"
