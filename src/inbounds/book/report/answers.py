"""What *Which policy?* answers: forests of the evidence, and the words that follow from it by rule.

rows = laws(outcomes_of_both(study_pages.shipped()))
first_choice(of(rows, algorithm="ppo"))
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from inbounds.book.report import html
from inbounds.book.report.equal_start import LAWS, Evidence, grade
from inbounds.book.report.forests import SERIES, Bar, in_words, of_robots
from inbounds.book.report.html import Shown
from inbounds.book.report.rows import of as of
from inbounds.book.report.ways_to_act import BOUNDED
from inbounds.book.report.words import HEADS, by_robot
from inbounds.study.grid import ROBOTS
from inbounds.study.second.yardsticks import ENDPOINTS
from inbounds.study.words import spoken


def sign(row: Evidence) -> int:
    """Return 1 where the difference is above 0, however well that is founded, −1 below, 0 where neither is shown."""
    if too_small(row) or grade(row) == "no difference found":
        return 0
    return 1 if row.difference.value > 0 else -1


def too_small(row: Evidence) -> bool:
    """Return whether the second study's rule says that a difference, if there is one, is too small to choose by."""
    return grade(row) == "too small to matter"


def first_choice(rows: Sequence[Evidence]) -> str:
    """Return the law to begin with, by a rule that knows no law's name; empty where none leads.

    A law leads that counts as above the equally quiet Gaussian somewhere, by either endpoint, and as below it nowhere
    (`sign`: what is too small to matter is neither). Of two, the one that does so on more robots and endpoints; of two
    alike, neither.

    Args:
        rows: of one algorithm, both endpoints.

    Example:
        >>> import numpy as np
        >>> from inbounds.study.statistics import Estimate
        >>> ahead = Estimate(np.array(9.0), np.array(4.0), np.array(14.0), 10, 0, 0.95, "difference of means")
        >>> first_choice([Evidence("Ant", "ppo", "beta", "final", ahead, study=1)])
        'beta'
    """
    best = _leading_laws(rows)
    return best[0] if len(best) == 1 else ""


def _leading_laws(rows: Sequence[Evidence]) -> list[str]:
    """Return the laws that lead on most robots and endpoints: one, none, or several alike."""
    signs = {law: [sign(row) for row in of(rows, law=law)] for law in LAWS}
    lead = {law: found.count(1) for law, found in signs.items() if 1 in found and -1 not in found}
    return [law for law, count in lead.items() if count == max(lead.values())]


def advice(rows: Sequence[Evidence], algorithm: str) -> str:
    """Return the recommendation that follows from the first choice, once every law was compared on every robot.

    Args:
        rows: of both endpoints.
        algorithm: ppo or trpo.

    Example:
        >>> advice([], "trpo")
        "Under TRPO too few robots have run: keep your library's law."
    """
    here = of(rows, algorithm=algorithm)
    if any({row.robot for row in of(here, law=law)} != set(ROBOTS) for law in LAWS):
        told = " too few robots have run: keep your library's law"
    elif choice := first_choice(here):
        told = f", try the {BOUNDED[choice]}"
    else:
        told = (
            f" {'both laws lead alike' if _leading_laws(here) else 'no law leads'}: keep your library's law"
        )
    return f"Under {algorithm.upper()}{told}."


def start_advice(rows: Sequence[Evidence]) -> str:
    """Return the recommendation that follows from what quiet starts do: firm where they raise one and lower none.

    Args:
        rows: of `equal_start.quiet_starts`.

    Example:
        >>> start_advice([])
        'Keep the usual start.'
    """
    above, below = map(len, sides(rows))
    if above <= below:
        return "Keep the usual start."
    return "Try a quiet start." if below else "Start quietly."


def counted(rows: Sequence[Evidence]) -> str:
    """Return on which robots the differences are found, suggested or too small to matter; says so where there are none.

    Example:
        >>> counted([])
        'not run yet'
    """
    return by_robot([(row.robot, _verdict(row)) for row in rows])


def found(rows: Sequence[Evidence]) -> str:
    """Return on which robots a difference is found, by a corrected test, and no other grade.

    Example:
        >>> found([])
        'not run yet'
    """
    if not rows:
        return "not run yet"
    return "found " + by_robot([(row.robot, _verdict(row) if grade(row) == "found" else "") for row in rows])


def _verdict(row: Evidence) -> str:
    """Return what a difference shows, in the words that `by_robot` sorts by."""
    above = row.difference.value > 0
    sorted_by: Mapping[str, str] = {
        "found": "higher" if above else "lower",
        "suggested": f"suggested {'above' if above else 'below'}",
        "no difference found": "unresolved",
    }
    return sorted_by.get(grade(row), grade(row))


def short(rows: Sequence[Evidence]) -> str:
    """Return on how many robots a law is above and below, without grades; of how many, where not all have run.

    Example:
        >>> short([])
        'not run yet'
    """
    if not rows:
        return "not run yet"
    counts = zip(map(len, sides(rows)), ("above", "below"), strict=True)
    told = ", ".join(f"{number}\u00a0{word}" for number, word in counts if number) or "no difference found"
    return told if len(rows) == len(ROBOTS) else f"{told} (of {len(rows)})"


def sides(rows: Sequence[Evidence]) -> tuple[list[Evidence], list[Evidence]]:
    """Return the differences that are above 0 and those that are below.

    Example:
        >>> sides([])
        ([], [])
    """
    above, below = ([row for row in rows if sign(row) == way] for way in (1, -1))
    return above, below


def leading(rows: Sequence[Evidence], *, graded: bool = True) -> str:
    """Return the differences that leave out 0, with their intervals, robot by robot; or that there is none.

    Args:
        rows: of one comparison.
        graded: say how well each is founded.

    Example:
        >>> leading([])
        'nowhere'
    """
    told = [
        f"{row.robot} {spoken(row.difference)}{f' ({grade(row)})' if graded else ''}"
        for row in rows
        if sign(row)
    ]
    return "; ".join(told) or "nowhere"


def bars(rows: Sequence[Evidence], *, both_studies: bool = False) -> list[Bar]:
    """Return the rows as bars of a forest; hollow where nothing is found.

    Args:
        rows: of a panel.
        both_studies: in the figure; then the first study's are hollow.
    """

    def hollow(row: Evidence) -> bool:
        return row.study == 1 if both_studies else grade(row) != "found"

    return [Bar(row.robot, row.law, row.difference, row.margin, hollow=hollow(row)) for row in rows]


def by_algorithm(rows: Sequence[Evidence]) -> Shown:
    """Return a forest of final returns, a panel an algorithm: each law against a Gaussian that starts equally quiet."""
    panels = {a.upper(): of(rows, algorithm=a, endpoint="final") for a in ("ppo", "trpo")}
    what = f"each law against an equally quiet start, {ENDPOINTS['final']}"
    return html.of_study(what, _drawn(panels), *(_waiting(panels) if any(panels.values()) else []))


def by_endpoint(rows: Sequence[Evidence], algorithm: str) -> Shown:
    """Return a forest with a panel an endpoint, of one algorithm, and its numbers, a row a robot (`place_of`)."""
    here = of(rows, algorithm=algorithm)
    drawn = _drawn({name: of(here, endpoint=e) for e, name in ENDPOINTS.items()})
    return html.of_study(f"from an equal start, {algorithm.upper()}", drawn, _numbers(here, algorithm))


def place_of(robot: str, algorithm: str) -> str:
    """Return the anchor of a robot's row below the forest of an algorithm.

    Example:
        >>> place_of("Walker2d", "ppo")
        'equal-ppo-walker2d'
    """
    return f"equal-{algorithm}-{robot.lower()}"


def _numbers(rows: Sequence[Evidence], algorithm: str) -> str:
    """Return the differences of an algorithm with their intervals and grades: a row a robot, whether run or not."""
    columns = [(e, law) for e in ENDPOINTS for law in LAWS]
    head = ["robot", *(f"{SERIES[law].label.split(' − ')[0]}, {HEADS[e]}" for e, law in columns)]

    def told(robot: str, endpoint: str, law: str) -> str:
        found = of(rows, robot=robot, endpoint=endpoint, law=law)
        numbers = [spoken(row.difference).replace(" ", "\N{NO-BREAK SPACE}") for row in found]
        return "\n".join(f"{n}\n{_told(row)}" for n, row in zip(numbers, found, strict=True)) or "not run"

    caption = (
        f"{algorithm.upper()}, minus a Gaussian that starts equally quiet: difference of means with its 95 % interval, "
        "and how well it is founded. An interval that ends within a hundredth of its width of 0 counts as holding it."
    )
    table = [[robot, *(told(robot, *each) for each in columns)] for robot in ROBOTS]
    return html.table(caption, head, table, anchors=[place_of(robot, algorithm) for robot in ROBOTS])


def _told(row: Evidence) -> str:
    """Return on which side of 0 a difference lies, and how well that is founded."""
    way = sign(row)
    return f"{'above' if way > 0 else 'below'}, {grade(row)}" if way else grade(row)


def quiet_gains(rows: Sequence[Evidence], algorithm: str) -> Shown:
    """Return a forest of a Gaussian that starts quietly minus one as it comes, a panel an endpoint.

    Args:
        rows: of `equal_start.quiet_starts`.
        algorithm: ppo or trpo.
    """
    here = of(rows, algorithm=algorithm)
    what = f"a quiet start, {algorithm.upper()}"
    panels = {name: bars(of(here, endpoint=e)) for e, name in ENDPOINTS.items()}
    if not here:
        return html.of_study(what, html.NONE_FINISHED)
    alt = f"{algorithm.upper()}. Quiet minus plain Gaussian with 95 percent intervals. {in_words(panels)}"
    lacking = [robot for robot in ROBOTS if not of(here, robot=robot)]
    strip = [html.missing(f"Not run: {', '.join(lacking)}.")] if lacking else []
    return html.of_study(what, html.figure_of(of_robots(panels), alt, _caption({algorithm: here})), *strip)


def _drawn(panels: Mapping[str, Sequence[Evidence]]) -> str:
    both = _studies(panels) == {1, 2}
    drawn = {title: bars(rows, both_studies=both) for title, rows in panels.items() if rows}
    if not drawn:
        return html.NONE_FINISHED
    said = "Differences with 95 percent intervals, a group of rows per robot."
    alt = f"{_one_algorithm(panels)}{said} {in_words(drawn)}"
    return html.figure_of(of_robots(drawn), alt, _caption(panels))


def _caption(panels: Mapping[str, Sequence[Evidence]]) -> str:
    rows = [row for found in panels.values() for row in found]
    studies = _studies(panels)
    said = [
        f"{_one_algorithm(panels)}Bars: 95 % bootstrap intervals of a difference of means. Grey: a difference too "
        "small to choose by, a fifth of what training adds on the robot."
    ]
    if studies == {1, 2}:
        said.append(
            "Filled: fresh seeds, the second study, whose Gaussian has a free σ, one per action dimension. Hollow: the "
            "first study, whose Gaussian has a σ that depends on the state."
        )
    else:
        tested = any(not math.isnan(row.p_adjusted) for row in rows)  # NaN: no protocol planned a test
        said.append(
            "Filled: found by a corrected test. Hollow: not."
            if tested
            else "All markers are hollow: no corrected test of these differences was planned."
        )
        said.append(
            "All from the second study, with fresh seeds." if studies == {2} else "All from the first study."
        )
    return " ".join([*said, *lent(rows)])


def _studies(panels: Mapping[str, Sequence[Evidence]]) -> set[int]:
    """Return which studies a figure's differences are from."""
    return {row.study for rows in panels.values() for row in rows}


def _one_algorithm(panels: Mapping[str, Sequence[Evidence]]) -> str:
    """Return the first sentence of a figure that has one algorithm; where panels differ in it, their titles say it."""
    algorithms = {row.algorithm for rows in panels.values() for row in rows}
    return f"{algorithms.pop().upper()}. " if len(algorithms) == 1 else ""


def lent(rows: Sequence[Evidence]) -> list[str]:
    """Return the sentence that names the laws which have their usual start, if there are any.

    Example:
        >>> import numpy as np
        >>> from inbounds.study.statistics import Estimate
        >>> ahead = Estimate(np.array(9.0), np.array(4.0), np.array(14.0), 10, 0, 0.95, "difference of means")
        >>> lent([Evidence("Ant", "trpo", "beta", "final", ahead, study=1, as_it_comes=True)])
        ['With its usual start, somewhat louder than 0.4: Ant, Beta (TRPO).']
    """
    found = {f"{row.robot}, {BOUNDED[row.law]} ({row.algorithm.upper()})" for row in rows if row.as_it_comes}
    return [f"With its usual start, somewhat louder than 0.4: {'; '.join(sorted(found))}."] if found else []


def _waiting(panels: Mapping[str, Sequence[Evidence]]) -> list[str]:
    """Return one strip that names what was not run."""
    lacking = {
        title: [
            f"{robot} ({', '.join(SERIES[law].label.split(' − ')[0] for law in laws)})"
            if len(laws) < len(LAWS)
            else robot
            for robot in ROBOTS
            if (laws := [law for law in LAWS if not of(rows, robot=robot, law=law)])
        ]
        for title, rows in panels.items()
    }
    told = [f"{title}: {', '.join(names)}" for title, names in lacking.items() if names]
    return [html.missing(f"Not run from an equal start. {'; '.join(told)}.")] if told else []
