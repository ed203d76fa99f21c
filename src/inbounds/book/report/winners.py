"""Who wins: robots against algorithms, each field a link to its evidence; and the finding of the front page.

rows = laws(outcomes_of_both(study_pages.shipped()))
winners(rows)
"""

from __future__ import annotations

from collections.abc import Sequence

from inbounds.book.report import html
from inbounds.book.report.answers import counted, graded, of, sign
from inbounds.book.report.equal_start import LAWS, Evidence, grade
from inbounds.book.report.html import Shown
from inbounds.study.grid import ROBOTS

ALGORITHMS = ("ppo", "trpo")
NAMES = {"beta": "Beta", "logit-normal": "logit-normal"}
EVIDENCE = "what_happened.html#from-an-equally-quiet-start"
"""Where the intervals stand behind every field."""


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
        told += [f"{NAMES[row.law]} {word} ({grade(row)})" for row in found]
    none = [NAMES[law] for law, way in signs.items() if way == 0]
    if none:
        told.append(
            "no difference found" if len(none) == len(rows) else f"{' and '.join(none)}: no difference found"
        )
    told += [f"{NAMES[law]} not run" for law in LAWS if law not in signs]
    return "; ".join(told)


def winners(rows: Sequence[Evidence], endpoint: str = "final") -> Shown:
    """Return the table of robots and algorithms that says who wins, each field a link to the intervals behind it.

    Args:
        rows: of `equal_start.laws`.
        endpoint: final or area.
    """
    here = of(rows, endpoint=endpoint)
    if not here:
        return html.of_study("who wins", html.NONE_FINISHED)
    fields = {
        robot: {algorithm: field(of(here, robot=robot, algorithm=algorithm)) for algorithm in ALGORITHMS}
        for robot in ROBOTS
    }
    caption = (
        "Final returns: each bounded law minus an equally quiet clipped Gaussian. Each field leads to its intervals; "
        "in brackets, how well it is founded."
    )
    return html.of_study("who wins", html.links(caption, ALGORITHMS, fields, EVIDENCE))


def finding(as_they_come: str, rows: Sequence[Evidence], law: str, algorithm: str) -> str:
    """Return the book's finding in one sentence: what a law gains as it comes, and what from an equally quiet start.

    Args:
        as_they_come: on how many robots the differences lie where, as `counted` says it, and how that was found.
        rows: of `equal_start.laws`.
        law: the bounded one.
        algorithm: ppo or trpo.

    Example:
        >>> finding("above on 4 of 6 robots", [], "beta", "ppo").partition(": ")[2]
        'as they come, above on 4 of 6 robots; from an equally quiet start, not run yet.'
    """
    here = of(rows, law=law, algorithm=algorithm, endpoint="final")
    grades = f" ({graded(here)})" if any(map(sign, here)) else ""
    return (
        f"Under {algorithm.upper()} the {NAMES[law]}, minus the clipped Gaussian: as they come, {as_they_come}; "
        f"from an equally quiet start, {counted(here)}{grades}."
    )


def by_test(words: Sequence[str]) -> str:
    """Return on how many robots the first study's test finds what, from its verdicts.

    Args:
        words: of `inbounds.study.words.verdict`, one a robot.

    Example:
        >>> by_test(["higher", "unresolved"])
        'above on 1 of 2 robots, below on 0 (found)'
    """
    return f"above on {words.count('higher')} of {len(words)} robots, below on {words.count('lower')} (found)"
