"""Who wins: robots against algorithms, each field a link to its evidence; and the finding of the front page.

rows = laws(outcomes_of_both(study_pages.shipped()))
winners(rows)
"""

from __future__ import annotations

from collections.abc import Sequence

from inbounds.book.report import html
from inbounds.book.report.answers import in_brackets, lent, of, place_of, sides, sign, too_small
from inbounds.book.report.equal_start import LAWS, Evidence, grade
from inbounds.book.report.html import Shown
from inbounds.book.report.ways_to_act import BOUNDED
from inbounds.book.report.words import robots
from inbounds.study.grid import ROBOTS

ALGORITHMS = ("ppo", "trpo")
EVIDENCE = "what_happened.html"
"""The page that has a row of intervals for every field."""


def field(rows: Sequence[Evidence]) -> str:
    """Return who wins on a robot under an algorithm: the laws above the Gaussian, those below it, what was not run.

    Args:
        rows: of one robot, algorithm and endpoint.

    Example:
        >>> import numpy as np
        >>> from inbounds.study.statistics import Estimate
        >>> ahead = Estimate(np.array(9.0), np.array(4.0), np.array(14.0), 10, 0, 0.95, "difference of means")
        >>> field([Evidence("Ant", "ppo", "beta", "final", ahead, study=1)])
        'Beta above (suggested); logit-normal not run'
        >>> field([])
        'not run'
    """
    if not rows:
        return "not run"
    signs = {row.law: sign(row) for row in rows}
    told = []
    for word, way in (("above", 1), ("below", -1)):
        found = [row for row in rows if signs[row.law] == way]
        told += [f"{BOUNDED[row.law]} {word} ({grade(row)})" for row in found]
    for word in ("too small to matter", "no difference found"):
        alike = [BOUNDED[row.law] for row in rows if grade(row) == word]
        if alike:
            told.append(word if len(alike) == len(rows) else f"{' and '.join(alike)}: {word}")
    told += [f"{BOUNDED[law]} not run" for law in LAWS if law not in signs]
    return "; ".join(told)


def winners(rows: Sequence[Evidence], endpoint: str = "final") -> Shown:
    """Return the table of robots and algorithms that says who wins, each field a link to its own row of intervals.

    Args:
        rows: of `equal_start.laws`.
        endpoint: final or area.
    """
    here = of(rows, endpoint=endpoint)
    if not here:
        return html.of_study("who wins", html.NONE_FINISHED)
    fields = {
        robot: {
            algorithm: (
                field(of(here, robot=robot, algorithm=algorithm)),
                f"{EVIDENCE}#{place_of(robot, algorithm)}",
            )
            for algorithm in ALGORITHMS
        }
        for robot in ROBOTS
    }
    caption = (
        "Final returns: each bounded law minus an equally quiet clipped Gaussian. Each field leads to its intervals; "
        "in brackets, how well it is founded."
    )
    return html.of_study("who wins", html.links(" ".join([caption, *lent(here)]), ALGORITHMS, fields))


def finding(as_they_come: str, rows: Sequence[Evidence], law: str, algorithm: str) -> str:
    """Return the book's finding: a sentence on what a law gains as it comes, then what from an equally quiet start.

    Args:
        as_they_come: on how many robots the law ends where, as `by_test` says it.
        rows: of `equal_start.laws`.
        law: the bounded one.
        algorithm: ppo or trpo.

    Example:
        >>> finding("above the clipped Gaussian on 4 of 6 robots", [], "beta", "ppo").partition(". ")[0]
        'From the usual starts, under PPO, the Beta is found above the clipped Gaussian on 4 of 6 robots'
    """
    here = of(rows, law=law, algorithm=algorithm, endpoint="final")
    name = BOUNDED[law]
    first = f"From the usual starts, under {algorithm.upper()}, the {name} is found {as_they_come}."
    if not here:
        return f"{first} From an equally quiet start the two were not compared yet."
    above, below = sides(here)
    told = (
        f"the {name} ends above on {_of(len(above), len(here))}{in_brackets(above)} "
        f"and below on {_none(len(below))}{in_brackets(below)}{_rest(here)}"
    )
    if areas := of(rows, law=law, algorithm=algorithm, endpoint="area"):
        above, below = sides(areas)
        told += (
            f". By the area under the learning curve it is above on {_none(len(above))}{in_brackets(above)} "
            f"and below on {_none(len(below))}{in_brackets(below)}{_rest(areas)}"
        )
    if all(row.study == 2 for row in here):
        return (
            f"{first} In a second study, with fresh seeds and a Gaussian whose σ is the same in every state, "
            f"both start equally quiet: there {told}."
        )
    return f"{first} When both start equally quiet, {told}."


def _rest(rows: Sequence[Evidence]) -> str:
    """Return on how many robots a difference is too small to matter, if there is one, and on how many none is found."""
    small = sum(map(too_small, rows))
    left = sum(not sign(row) for row in rows) - small
    told = f"; on {small} a difference, if there is one, is too small to matter" if small else ""
    return f"{told}; on {left} no difference is found" if left else told


def by_test(words: Sequence[str]) -> str:
    """Return on how many robots the first study's test finds a law above and below, from its verdicts.

    Args:
        words: of `inbounds.study.words.verdict`, one a robot.

    Example:
        >>> by_test(["higher", "unresolved"])
        'above the clipped Gaussian on 1 of 2 robots and below it on none'
    """
    above, below = _of(words.count("higher"), len(words)), _none(words.count("lower"))
    return f"above the clipped Gaussian on {above} and below it on {below}"


def _of(count: int, total: int) -> str:
    """Return 4 of 6 robots."""
    return f"{count} of {robots(total)}"


def _none(count: int) -> str:
    """Return a count, 0 as none."""
    return str(count or "none")
