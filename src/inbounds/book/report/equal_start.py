"""What starting quietly is worth, and what a law is worth from an equally quiet start: the evidence, and its grade.

Two studies have such numbers. The second (`results/PROTOCOL-2.md`) asked for them before its first run, with fresh
seeds and a test; the first has cells with executed noise 0.4, which no test of its protocol covers, and some of which
were asked for afterwards. On each robot the second study's number is taken as soon as both of its sides have a
finished cell, the first's until then.

    rows = laws(outcomes_of_both(study_pages.shipped()))
    [grade(row) for row in rows]
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal, TypeAlias

from inbounds.study.analysis import difference_of
from inbounds.study.grid import AFTERWARDS, FREE, ROBOTS, second_cells
from inbounds.study.outcomes import Column, Outcome, Outcomes
from inbounds.study.second import GAUSSIAN, MARGINS, Pair, compared, pooled_difference, primary
from inbounds.study.second.pooled import pooled
from inbounds.study.second.primary import BOUNDED, are_whole, finding
from inbounds.study.second.yardsticks import ENDPOINTS
from inbounds.study.statistics import Estimate
from inbounds.study.statistics.settings import SIGNIFICANCE
from inbounds.study.words import side

Grade: TypeAlias = Literal[
    "found",
    "too small to matter",
    "suggested",
    "no difference found",
]
LAWS = ("beta", "logit-normal")
"""The bounded ones, in the order of the pages."""
USUAL = Column("as-they-come", "ppo", "gaussian", FREE)
"""What people run: a Gaussian with a free σ that starts at 1."""


@dataclass(frozen=True)
class Evidence:
    """A difference between two columns on a robot, and what stands behind it.

    Example:
        >>> import numpy as np
        >>> ahead = Estimate(np.array(9.0), np.array(4.0), np.array(14.0), 10, 0, 0.95, "difference of means")
        >>> grade(Evidence("Ant", "ppo", "beta", "final", ahead, study=1))
        'suggested'
    """

    robot: str
    """Where."""
    algorithm: str
    """ppo or trpo."""
    law: str
    """The first side's family; gaussian for a quiet start minus the start as it comes."""
    endpoint: str
    """final or area."""
    difference: Estimate
    """First minus second, 100 000 resamples."""
    study: Literal[1, 2]
    """Which study's cells."""
    p_adjusted: float = float("nan")
    """Of the protocol's test after its correction; NaN where the protocol has none, or seeds are missing."""
    whole: bool = True
    """Whether all planned seeds of both sides are there."""
    primary: bool = False
    """Whether the second protocol's rule for its primary comparison decides."""
    as_it_comes: bool = False
    """Whether the law's own start was left as it is, nearly as quiet as the Gaussian's."""

    @property
    def margin(self) -> float:
        """Below which a difference does not matter, by the second protocol."""
        return MARGINS[self.endpoint][self.robot]


def grade(evidence: Evidence) -> Grade:
    """Return how well a difference is founded: the only place that decides it.

    Returns:
        * *too small to matter*, before the others: by the second protocol's rule for its primary comparison, all
          planned seeds are there and the interval lies within the margin;
        * *found*: all planned seeds are there, and the corrected test that its study planned finds it;
        * *suggested*: the interval leaves out 0, but no corrected test finds it, or seeds are still to be run;
        * *no difference found*: the interval holds 0.

    Example:
        >>> import dataclasses
        >>> import numpy as np
        >>> ahead = Estimate(np.array(9.0), np.array(4.0), np.array(14.0), 10, 0, 0.95, "difference of means")
        >>> first = Evidence("Ant", "ppo", "beta", "final", ahead, study=1, p_adjusted=0.01)
        >>> grade(first), grade(dataclasses.replace(first, whole=False))
        ('found', 'suggested')
    """
    gap, apart = evidence.difference, clear(evidence.difference)
    tested = evidence.whole and evidence.p_adjusted < SIGNIFICANCE  # NaN is not below
    if evidence.primary and evidence.whole:
        told = finding(gap, evidence.p_adjusted, evidence.margin)
        if told == "refuted":
            return "too small to matter"
        if told in ("confirmed", "contradicted"):
            return "found"
        tested = False
    if not apart:
        return "no difference found"
    return "found" if tested else "suggested"


def clear(estimate: Estimate) -> int:
    """Return on which side of 0 an interval lies, 0 where it holds 0 or ends within a hundredth of its width of it.

    So far the luck of the resampling may move an end.

    Example:
        >>> import numpy as np
        >>> ends = [(0.02, 56.4), (2.0, 58.0), (-9.0, -1.0)]
        >>> [clear(Estimate(np.array(0.0), *map(np.array, each), 10, 0, 0.95, "difference of means")) for each in ends]
        [0, 1, -1]
    """
    slack = (estimate.high - estimate.low) / 100
    return side(estimate.low - slack, estimate.high + slack)


def outcomes_of_both(first: Outcomes) -> Outcomes:
    """Return the outcomes of the first study with what was asked afterwards and with the second study's."""
    return first.and_of(AFTERWARDS).and_of(second_cells())


def with_second(outcomes: Outcomes) -> Outcomes:
    """Return outcomes that know the second study's cells, too."""
    known = {cell.id for cell in second_cells()} <= outcomes.states.keys()
    return outcomes if known else outcomes.and_of(second_cells())


def laws(outcomes: Outcomes) -> list[Evidence]:
    """Return each bounded law minus a Gaussian that starts equally quiet, wherever there are cells for it.

    Args:
        outcomes: of both studies, as `outcomes_of_both` returns them.

    Returns:
        By algorithm, endpoint, robot and law. Under PPO the second study's Gaussian has a free σ, the first's one of
        the state; under TRPO likewise.

    Example:
        >>> from pathlib import Path
        >>> from inbounds.study import StudyFolder
        >>> laws(outcomes_of_both(Outcomes.read(StudyFolder(Path("no/results")))))
        []
    """
    fresh = {
        (e.algorithm, e.endpoint, e.robot, e.law): e for e in (*_primary(outcomes), *_under_trpo(outcomes))
    }
    rows = []
    for algorithm in ("ppo", "trpo"):
        for endpoint in ENDPOINTS:
            for robot in ROBOTS:
                for law in LAWS:
                    found = fresh.get((algorithm, endpoint, robot, law))
                    rows.append(found or _of_first_study(outcomes, algorithm, law, robot, endpoint))
    return [row for row in rows if row is not None]


def quiet_starts(outcomes: Outcomes) -> list[Evidence]:
    """Return a Gaussian that starts with executed noise 0.4 minus the same with σ = 1, wherever there are cells.

    Args:
        outcomes: of both studies, as `outcomes_of_both` returns them.

    Example:
        >>> from pathlib import Path
        >>> from inbounds.study import StudyFolder
        >>> quiet_starts(outcomes_of_both(Outcomes.read(StudyFolder(Path("no/results")))))
        []
    """
    rows: list[Evidence | None] = []
    for algorithm in ("ppo", "trpo"):
        for endpoint in ENDPOINTS:
            found = _tested(outcomes, GAUSSIAN, USUAL, endpoint) if algorithm == "ppo" else {}
            for robot in ROBOTS:
                pair = (
                    _quiet(outcomes, algorithm, "gaussian", robot),
                    _plain(outcomes, algorithm, "gaussian", robot),
                )
                first = _minus(*pair, endpoint)
                rows.append(found.get(robot) or first)
    return [row for row in rows if row is not None]


def exploratory(outcomes: Outcomes, gaussian: Column, endpoint: str) -> list[Evidence]:
    """Return each bounded law under PPO, with its equally quiet start, minus a Gaussian; no protocol tests it.

    Args:
        outcomes: of both studies, as `outcomes_of_both` returns them.
        gaussian: a column of the second study: `GAUSSIAN`, which is as quiet, or `USUAL`.
        endpoint: a key of `ENDPOINTS`, or "greedy", the return by the median.

    Returns:
        By law and robot, wherever both have a finished cell.

    Example:
        >>> from pathlib import Path
        >>> from inbounds.study import StudyFolder
        >>> exploratory(outcomes_of_both(Outcomes.read(StudyFolder(Path("no/results")))), USUAL, "final")
        []
    """
    rows = []
    for law in LAWS:
        pair = Column("equal", "ppo", law), gaussian
        for robot in ROBOTS:
            if (found := pooled_difference(outcomes, *pair, robot, endpoint)) is not None:
                whole = are_whole(outcomes, *pair, robot)
                rows.append(Evidence(robot, "ppo", law, endpoint, found, study=2, whole=whole))
    return rows


def loud_pair(outcomes: Outcomes, robot: str) -> list[Outcome]:
    """Return a logit-normal that starts as loud as a Gaussian as it comes, and that Gaussian; nothing if one lacks."""
    columns = (
        Column("afterwards", "trpo", "logit-normal", "loud-noise"),
        Column("standard", "trpo", "gaussian"),
    )
    found = [each for column in columns if (each := outcomes.find(column, robot)) is not None]
    return found if len(found) == len(columns) else []


def loud_starts(outcomes: Outcomes) -> list[Evidence]:
    """Return the first minus the second of `loud_pair`, wherever there are both.

    Args:
        outcomes: of both studies, as `outcomes_of_both` returns them.

    Example:
        >>> from pathlib import Path
        >>> from inbounds.study import StudyFolder
        >>> loud_starts(outcomes_of_both(Outcomes.read(StudyFolder(Path("no/results")))))
        []
    """
    return [
        Evidence(
            robot,
            "trpo",
            "logit-normal",
            endpoint,
            difference_of(pair[0], pair[1], endpoint),
            study=1,
        )
        for robot in ROBOTS
        if (pair := loud_pair(outcomes, robot))
        for endpoint in ENDPOINTS
    ]


def sides(outcomes: Outcomes, evidence: Evidence) -> tuple[list[Outcome], list[Outcome]]:
    """Return the finished cells of both sides of a row of `laws`: the bounded law's, then the Gaussian's.

    Args:
        outcomes: of both studies, as `outcomes_of_both` returns them.
        evidence: one of the rows that `laws` returns for them.

    Returns:
        One cell a side, two where the second study has run further seeds of it.

    Example:
        >>> from inbounds.study import StudyFolder
        >>> both = outcomes_of_both(Outcomes.read(StudyFolder()))  # in the project's folder
        >>> law, gaussian = sides(both, laws(both)[0])
        >>> law[0].cell.family, gaussian[0].cell.family
        ('beta', 'gaussian')
    """
    algorithm, law, robot = evidence.algorithm, evidence.law, evidence.robot
    if evidence.study == 2:
        columns = Column("equal", algorithm, law), Column("equal", algorithm, "gaussian", FREE)
        first, second = (pooled(outcomes, column, robot) for column in columns)
        return first, second
    bounded = _quiet(outcomes, algorithm, law, robot) or _plain(outcomes, algorithm, law, robot)
    gaussian = _quiet(outcomes, algorithm, "gaussian", robot)
    return [each for each in (bounded,) if each], [each for each in (gaussian,) if each]


def _primary(outcomes: Outcomes) -> Iterable[Evidence]:
    for row in primary(outcomes):
        if row.difference is not None:
            p = row.p_adjusted if row.whole else float("nan")
            yield Evidence(
                row.robot, "ppo", row.law, row.endpoint, row.difference, 2, p, row.whole, primary=True
            )


def _under_trpo(outcomes: Outcomes) -> Iterable[Evidence]:
    gaussian = Column("equal", "trpo", "gaussian", FREE)
    for law in BOUNDED:
        for endpoint in ENDPOINTS:
            yield from _tested(outcomes, Column("equal", "trpo", law), gaussian, endpoint).values()


def _tested(outcomes: Outcomes, first: Column, second: Column, endpoint: str) -> dict[str, Evidence]:
    """Return a secondary comparison of the second study by robot, corrected over its robots as the protocol has it."""
    place = first.algorithm, first.family, endpoint
    return {
        robot: Evidence(
            robot, *place, each.difference, 2, each.p_adjusted, are_whole(outcomes, first, second, robot)
        )
        for robot, each in compared(outcomes, Pair(first, second), endpoint).items()
        if each.difference is not None
    }


def _of_first_study(
    outcomes: Outcomes, algorithm: str, law: str, robot: str, endpoint: str
) -> Evidence | None:
    quiet = _quiet(outcomes, algorithm, law, robot)
    found = quiet or _plain(outcomes, algorithm, law, robot)
    return _minus(found, _quiet(outcomes, algorithm, "gaussian", robot), endpoint, as_it_comes=quiet is None)


def _minus(
    first: Outcome | None, second: Outcome | None, endpoint: str, *, as_it_comes: bool = False
) -> Evidence | None:
    """Return the difference of two cells of the first study; its protocol tests none of those here."""
    if first is None or second is None:
        return None
    cell = first.cell
    told = difference_of(first, second, endpoint)
    return Evidence(cell.robot, cell.algorithm, cell.family, endpoint, told, 1, as_it_comes=as_it_comes)


def _quiet(outcomes: Outcomes, algorithm: str, family: str, robot: str) -> Outcome | None:
    """Return the first study's cell with executed noise 0.4, planned or asked for afterwards."""
    arms = (Column(arm, algorithm, family, "matched-noise") for arm in ("mechanisms", "afterwards"))
    return next((o for column in arms if (o := outcomes.find(column, robot)) is not None), None)


def _plain(outcomes: Outcomes, algorithm: str, family: str, robot: str) -> Outcome | None:
    """Return the first study's cell as the family comes."""
    arms = (Column(arm, algorithm, family) for arm in ("standard", "beyond"))
    return next((o for column in arms if (o := outcomes.find(column, robot)) is not None), None)
