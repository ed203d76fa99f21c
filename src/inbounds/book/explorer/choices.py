"""What the explorer shows for every choice, as plain data: curves, differences, verdicts, sentences, what is missing.

    data = choices(study_pages.shipped())
    data["rows"]["standard-ppo-final"][0]["told"]

The numbers are those of the static pages, from the same functions: `equal_start.laws`, `as_they_come.compared`,
`analysis.curve`, `analysis.estimate`. A curve keeps every tenth epoch, as it is, and the first.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inbounds.book import verdicts
from inbounds.book.drawing.figures import LOOKS
from inbounds.book.explorer.pooled import pooled_curve, pooled_estimate
from inbounds.book.report import answers, as_they_come
from inbounds.book.report.as_they_come import Compared
from inbounds.book.report.equal_start import (
    LAWS,
    Evidence,
    grade,
    laws,
    loud_pair,
    loud_starts,
    outcomes_of_both,
    sides,
)
from inbounds.book.report.forests import SERIES
from inbounds.book.report.study_figures import SHORT
from inbounds.book.report.words import ALGORITHMS
from inbounds.study.analysis import CONTRASTS
from inbounds.study.grid import ROBOTS
from inbounds.study.outcomes import Outcome, Outcomes
from inbounds.study.second import MARGINS
from inbounds.study.second.yardsticks import ENDPOINTS
from inbounds.study.words import side, spoken

STARTS = {
    "equal": "from an equally quiet start",
    "standard": "from the usual starts",
    "loud": "from an equally loud start",
    "printed": "as the thesis prints",
}
"""Start → what it is called."""
EVERY = 10
"""A curve keeps one epoch of so many."""
_ARMS = {
    "standard": ("standard", "beyond"),
    "printed": ("printed",),
}  # CAPG stands beside the families from their usual starts
Row = Evidence | Compared


@dataclass(frozen=True)
class Place:
    """A finished difference of two families, and the cells of both sides.

    Made by `places`.
    """

    start: str
    """A key of `STARTS`."""
    algorithm: str
    """ppo or trpo."""
    pair: tuple[str, str]
    """First and second family."""
    row: Row
    """The difference on one robot and endpoint."""
    cells: tuple[list[Outcome], list[Outcome]]
    """Of the first side and of the second."""

    @property
    def key(self) -> str:
        """By start, algorithm and endpoint."""
        return f"{self.start}-{self.algorithm}-{self.row.endpoint}"

    @property
    def stands_in(self) -> bool:
        """Whether the first study's cells stand in for the second's."""
        return self.start == "equal" and isinstance(self.row, Evidence) and self.row.study == 1


def planned(start: str, algorithm: str) -> list[tuple[str, str]]:
    """Return the pairs of families that are compared, in the order of the static pages.

    Example:
        >>> planned("printed", "trpo")
        [('logit-normal', 'gaussian')]
    """
    if start == "equal":
        return [(law, "gaussian") for law in LAWS]
    if start == "loud":
        return [("logit-normal", "gaussian")] if algorithm == "trpo" else []
    return [(c.first, c.second) for c in CONTRASTS if c.arm in _ARMS[start] and c.algorithm == algorithm]


def places(outcomes: Outcomes) -> list[Place]:
    """Return all finished differences.

    Args:
        outcomes: of the first study; the second's are read from the same folder.

    Example:
        >>> from pathlib import Path
        >>> from inbounds.study.store import StudyFolder
        >>> places(Outcomes.read(StudyFolder(Path("no/results"))))
        []
    """
    both = outcomes_of_both(outcomes)
    found = [
        Place("equal", row.algorithm, (row.law, "gaussian"), row, sides(both, row)) for row in laws(both)
    ]
    for told in loud_starts(both):
        loud, plain = loud_pair(both, told.robot)
        found.append(Place("loud", told.algorithm, (told.law, "gaussian"), told, ([loud], [plain])))
    for start, arms in _ARMS.items():
        for row in (row for arm in arms for row in as_they_come.compared(outcomes, arm)):
            first, second = (outcomes.of_column(c, [row.robot]) for c in row.contrast.columns)
            pair = row.contrast.first, row.contrast.second
            found.append(Place(start, row.contrast.algorithm, pair, row, (first, second)))
    return found


def verdict(row: Row, *, brief: bool = False) -> str:
    """Return what a difference shows, and how well that is founded.

    Args:
        row: the difference.
        brief: without the effects that remain possible, for a place that has the interval beside it.

    Example:
        >>> from inbounds.study.statistics import Estimate
        >>> ahead = Estimate(np.array(9.0), np.array(4.0), np.array(14.0), 10, 0, 0.95, "difference of means")
        >>> verdict(Evidence("Ant", "ppo", "beta", "final", ahead, study=1))
        'above, suggested'
    """
    said = verdicts.verdict(row.difference, unit=" points")
    said = said.partition(" (")[0] if brief else said
    apart = side(row.difference.low, row.difference.high)
    if isinstance(row, Evidence):
        if grade(row) == "no difference found":
            return f"{grade(row)}, the interval ends at 0" if apart else said
        return f"{said}, {grade(row)}" if apart and not answers.too_small(row) else grade(row)
    if not apart:
        return said
    if not row.found:
        return f"{said}, not found after Holm"
    return f"{said}, {'found, fragile' if row.fragile else 'found'}"


def sentence(rows: Sequence[Row]) -> str:
    """Return what one pair of families shows on some robots: a static page's words, or one robot's number.

    Example:
        >>> sentence([])
        'not run yet'
    """
    if len(rows) == 1:
        return f"{spoken(rows[0].difference)} points on {rows[0].robot}, {verdict(rows[0])}"
    if all(isinstance(row, Compared) for row in rows):
        return as_they_come.told([row for row in rows if isinstance(row, Compared)])
    return answers.counted([row for row in rows if isinstance(row, Evidence)])


def choices(outcomes: Outcomes) -> dict[str, Any]:
    """Return what every choice shows, ready for JSON.

    Args:
        outcomes: of the first study, as `study_pages.shipped` reads them.

    Returns:
        robots, starts, endpoints and families by name; `epochs`, those that a curve keeps, as env steps in millions;
        `curves` by start and algorithm, then robot; `rows` by start, algorithm and endpoint, their ends in margins;
        `sentences` likewise, by pair, an index into `texts` for each set of robots, as bits in the order of `robots`;
        `pairs` that are planned, with their names.

    Example:
        >>> from pathlib import Path
        >>> from inbounds.study.store import StudyFolder
        >>> data = choices(Outcomes.read(StudyFolder(Path("no/results"))))
        >>> data["robots"] == list(ROBOTS), data["rows"]
        (True, {})
    """
    found = places(outcomes)
    texts: dict[str, int] = {}
    keys = dict.fromkeys(place.key for place in found)
    return {
        "robots": list(ROBOTS),
        "starts": STARTS,
        "endpoints": dict(ENDPOINTS),
        "families": {family: SHORT[family] for family in LOOKS},
        "pairs": {
            f"{start}-{algorithm}": [
                [*pair, SERIES[_series(pair)].label] for pair in planned(start, algorithm)
            ]
            for start in STARTS
            for algorithm in ALGORITHMS
        },
        "epochs": _epochs(found),
        "curves": _curves(found),
        "rows": {key: [_row(place) for place in found if place.key == key] for key in keys},
        "sentences": {key: _sentences([p for p in found if p.key == key], texts) for key in keys},
        "texts": list(texts),
    }


def _series(pair: tuple[str, str]) -> str:
    first, second = pair
    return first if second == "gaussian" else f"{first}, {second}"


def _row(place: Place) -> dict[str, Any]:
    row = place.row
    margin = MARGINS[row.endpoint][row.robot]
    gap = row.difference
    found = row.found if isinstance(row, Compared) else grade(row) == "found"
    return {
        "robot": row.robot,
        "pair": list(place.pair),
        "ends": [_short(float(end) / margin, 3) for end in (gap.low, gap.value, gap.high)],
        "told": f"{spoken(gap)}: {verdict(row, brief=True)}",
        "filled": bool(found),
    }


def _sentences(found: Sequence[Place], texts: dict[str, int]) -> dict[str, list[int]]:
    """Return by pair and set of robots, as bits, the place of its sentence in `texts`; −1 where a row is missing."""
    by_pair: dict[str, list[int]] = {}
    for pair in dict.fromkeys(place.pair for place in found):
        rows = {place.row.robot: place.row for place in found if place.pair == pair}
        told = [-1] * 2 ** len(ROBOTS)
        for size in range(len(rows) + 1):
            for robots in combinations([robot for robot in ROBOTS if robot in rows], size):
                words = sentence([rows[robot] for robot in robots])
                bits = sum(2 ** ROBOTS.index(robot) for robot in robots)
                told[bits] = texts.setdefault(words, len(texts))
        by_pair[",".join(pair)] = told
    return by_pair


def kept_of(epochs: int) -> NDArray[np.int_]:
    """Return the epochs that a curve keeps of so many, `[K]`, counted from 0.

    Example:
        >>> kept_of(30).tolist()
        [0, 9, 19, 29]
    """
    return np.unique([0, *range(EVERY - 1, epochs, EVERY)])


def _epochs(found: Iterable[Place]) -> list[float]:
    """Return the env steps of one seed at the epochs that are kept [millions]; all cells share them."""
    known = {tuple(cell.steps[kept_of(len(cell.steps))]) for cell in _cells(found)}
    if len(known) > 1:
        raise ValueError("cells with different epochs share no axis: draw them apart")
    return [_short(step / 1e6, 4) for step in next(iter(known), ())]


def _cells(found: Iterable[Place]) -> Iterator[Outcome]:
    for place in found:
        for cells in place.cells:
            yield from cells


def _curves(found: Sequence[Place]) -> dict[str, dict[str, list[dict[str, Any]]]]:
    """Return by start and algorithm, then robot, the curves of all cells that some difference compares, each once."""
    curves: dict[str, dict[str, list[dict[str, Any]]]] = {}
    known: dict[
        tuple[str, ...], dict[str, Any]
    ] = {}  # a cell may stand in at one start, and be at home at another
    for place in found:
        here = curves.setdefault(f"{place.start}-{place.algorithm}", {}).setdefault(place.row.robot, [])
        for cells in place.cells:
            ids = (place.start, *(cell.cell.id for cell in cells))
            one = known.get(ids) or known.setdefault(ids, _curve(place, cells))
            if one not in here:
                here.append(one)
    order = list(LOOKS)
    for by_robot in curves.values():
        for drawn in by_robot.values():
            drawn.sort(key=lambda one: (order.index(one["family"]), one["thin"]))
    return curves


def _curve(place: Place, cells: Sequence[Outcome]) -> dict[str, Any]:
    band, family = pooled_curve(cells), cells[0].cell.family
    kept = kept_of(len(cells[0].steps))
    which = {
        ("equal", "gaussian"): ", σ(s)" if place.stands_in else ", free σ",
        ("loud", "logit-normal"): ", loud",
    }
    return {
        "family": family,
        "name": SHORT[family] + which.get((place.start, family), ""),
        "thin": place.stands_in,
        "told": {endpoint: spoken(pooled_estimate(cells, endpoint)) for endpoint in ENDPOINTS},
        **{
            name: [_short(float(x), 4) for x in np.asarray(values)[kept]]
            for name, values in (("value", band.value), ("low", band.low), ("high", band.high))
        },
    }


def _short(x: float, digits: int) -> float:
    """Return a number with so many significant digits, a whole one where it has no more."""
    rounded = float(f"{x:.{digits}g}")
    return int(rounded) if rounded == int(rounded) else rounded


__all__ = [
    "EVERY",
    "STARTS",
    "Place",
    "choices",
    "kept_of",
    "places",
    "planned",
    "sentence",
    "verdict",
]
