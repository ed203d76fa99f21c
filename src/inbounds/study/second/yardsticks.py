"""What the second study measures with: returns that were known before its first run, and margins made of them.

Every number here stands in `results/PROTOCOL-2.md` and is a constant of the analysis; a test computes it again from the
first study's files and from the robots.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from inbounds.study import statistics
from inbounds.study.cell import ROBOTS
from inbounds.study.outcomes import Column, Floats, Outcomes
from inbounds.study.second.pooled import is_whole, scores_by_robot

ENDPOINTS: Mapping[str, str] = MappingProxyType(
    {"final": "final return", "area": "area under the learning curve"}
)
"""The primary endpoints, those of the first study."""


def _by_robot(*values: float) -> Mapping[str, float]:
    return MappingProxyType(dict(zip(ROBOTS, values, strict=True)))


DO_NOTHING = _by_robot(-0.24, 145.58, 0.47, 94.46, 994.07, 198.53)
"""Mean return of 100 episodes in which every action is 0, from the starts 0 to 99."""
BEST = MappingProxyType(
    {
        "final": _by_robot(6077.34, 2127.81, 119.68, 3209.66, 1335.21, 1184.44),
        "area": _by_robot(4103.92, 1701.90, 91.16, 1955.75, 956.34, 706.00),
    }
)
"""The highest mean of a column of the first study's first arm, by endpoint."""
MARGINS = MappingProxyType(
    {
        "final": _by_robot(1250, 420, 24, 640, 240, 210),
        "area": _by_robot(860, 340, 18, 390, 170, 115),
    }
)
"""A difference smaller than this does not matter: a fifth of what training adds, `BEST` minus the first epoch of the
first study's quiet Gaussian under PPO, rounded."""


def normalized(outcomes: Outcomes, column: Column, endpoint: str) -> dict[str, Floats] | None:
    """Return a column's scores by robot, doing nothing at 0 and the best final return of the first study at 1.

    Args:
        outcomes: of the second study.
        column: within the arm `equal`, whose further seeds join it, or another arm.
        endpoint: a key of `ENDPOINTS`, or "greedy"; all are normalised by the same two numbers.

    Returns:
        `[S]` by robot; None unless all planned seeds of the column are finished on all six.

    Example:
        >>> from inbounds.study import StudyFolder
        >>> from pathlib import Path
        >>> normalized(Outcomes.read(StudyFolder(Path("no/results"))), Column("equal", "ppo", "beta"), "final") is None
        True
    """
    raw = scores_by_robot(outcomes, column, endpoint)
    if raw.keys() < set(ROBOTS) or not all(is_whole(outcomes, column, robot) for robot in ROBOTS):
        return None
    best = BEST["final"]
    return {
        robot: statistics.normalize_scores(raw[robot], DO_NOTHING[robot], best[robot]) for robot in ROBOTS
    }
