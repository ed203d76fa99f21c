"""Who wins: robots against algorithms, each field a link to its evidence.

rows = laws(outcomes_of_both(study_pages.shipped()))
winners(rows)
"""

from __future__ import annotations

from collections.abc import Sequence

from inbounds.book.report import html
from inbounds.book.report.answers import lent, of, place_of, sign
from inbounds.book.report.equal_start import LAWS, Evidence, grade
from inbounds.book.report.html import Shown
from inbounds.book.report.ways_to_act import BOUNDED
from inbounds.book.report.words import ALGORITHMS
from inbounds.study.grid import ROBOTS

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


def winners(rows: Sequence[Evidence]) -> Shown:
    """Return the table of robots and algorithms that says who wins, each field a link to its own row of intervals.

    Args:
        rows: of `equal_start.laws`.
    """
    here = of(rows, endpoint="final")
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
