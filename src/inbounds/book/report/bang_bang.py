"""What the study's final policies earn when every action is moved to the nearer of its bounds.

    rows = rows_of(StudyFolder.shipped())
    fig = ways_to_act.draw(rows, WAYS)

From `results/evaluations` (`inbounds.study.ways_played`): nothing is played here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from inbounds.book.report.ways_to_act import Row, gain, in_words
from inbounds.study.grid import ROBOTS, all_cells
from inbounds.study.store import StudyFolder
from inbounds.study.ways_played import evaluated, read_ways

WAYS: Mapping[str, str] = {"median-snapped": "median, snapped", "sample-snapped": "sample, snapped"}
"""What is compared with the median as it is, and its panel's title."""

ENOUGH = 10
"""Seeds, for an interval: a cell that keeps the policies of fewer is left out."""


@dataclass(frozen=True)
class BangBangRow(Row):
    """What a cell's policies earn at the bounds; its gains have the keys of `WAYS`.

    Made by `rows_of`, which has an example.
    """

    at_bounds: float
    """Share of the median's action components within 0.1 % of a bound, a mean over seeds."""
    reversals: Mapping[str, float]
    """By way to act: share of action components of another sign than a step before, a mean over seeds."""


def rows_of(folder: StudyFolder) -> list[BangBangRow]:
    """Return one row for each cell of whose seeds enough have been played, robot by robot.

    Example:
        >>> rows = rows_of(StudyFolder())  # in the project's folder
        >>> hopper = next(row for row in rows if (row.robot, row.label) == ("Hopper", "PPO, Beta"))
        >>> hopper.found("median-snapped")
        -1
    """
    rows = []
    for cell in evaluated(folder, all_cells()):
        if len(cell.kept_seeds) < ENOUGH:
            continue
        ways = read_ways(folder, cell)
        median = ways["median"].returns.mean(1)  # [S]
        gains = {way: gain(ways[way].returns.mean(1), median) for way in WAYS}
        rows.append(
            BangBangRow(
                cell.robot,
                in_words(cell),
                cell.family,
                gains,
                float(np.nanmean(ways["median"].actions["at_bounds"])),
                {way: float(np.nanmean(played.actions["reversals"])) for way, played in ways.items()},
            )
        )
    return sorted(rows, key=lambda row: (ROBOTS.index(row.robot), row.label.count(","), row.label))
