"""What another way to act than the median earns on the study's final policies: a figure, and its verdict in counts.

    rows = rows_of(study_pages.shipped())
    fig = draw(rows)

Only of the Beta and the logit-normal, whose mean, median and mode all differ.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from inbounds.book.drawing.figures import LOOKS, WIDTH
from inbounds.book.report.equal_start import clear
from inbounds.book.report.words import change_name
from inbounds.study.grid import ROBOTS, Cell
from inbounds.study.outcomes import Outcome, Outcomes
from inbounds.study.statistics import Estimate, difference
from inbounds.study.statistics.settings import MANY_RESAMPLES

BOUNDED: Mapping[str, str] = {"beta": "Beta", "logit-normal": "logit-normal"}
"""Families with three centres, and their names within a label."""
NAMES: Mapping[str, str] = {"gaussian": "Gaussian", "clipped-gaussian": "CAPG", **BOUNDED}
"""All families, likewise."""
WAYS: Mapping[str, str] = {"mean": "mean", "mode": "mode", "sample": "noise kept"}
"""What is compared with the median, and its panel's title."""
_ROW_HEIGHT = 0.24  # inches


@dataclass(frozen=True)
class Row:
    """What a cell's policies earn by other ways to act.

    Made by `rows_of`, which has an example.
    """

    robot: str
    """Of the cell."""
    label: str
    """Algorithm, family and what is changed, in words; unique within a robot."""
    family: str
    """Of the cell."""
    gains: Mapping[str, Estimate]
    """By way to act (`WAYS`): the return less the median's, a mean over seeds, in % of the median's return."""

    def found(self, way: str) -> int:
        """Return the sign of the difference, 0 where its 95 % interval holds zero (`equal_start.clear`).

        Example:
            >>> gain = Estimate(-3.0, -5.0, -1.0, 10, 0, 0.95, "difference of means")
            >>> Row("Ant", "PPO, Beta", "beta", {"mode": gain}).found("mode")
            -1
        """
        return clear(self.gains[way])


def rows_of(outcomes: Outcomes) -> list[Row]:
    """Return one row for each finished cell of a bounded family whose policies were kept, robot by robot.

    Args:
        outcomes: of the study.

    Example:
        >>> from inbounds.study import StudyFolder, select
        >>> outcomes = Outcomes.read(StudyFolder(), select(["standard-ant-ppo-beta"]))  # in the project's folder
        >>> [(row.robot, row.label, row.found("mode")) for row in rows_of(outcomes)]
        [('Ant', 'PPO, Beta', -1)]
    """
    kept = [o for o in outcomes.finished.values() if o.ways and o.cell.family in BOUNDED]
    rows = [Row(o.cell.robot, in_words(o.cell), o.cell.family, _gains(o)) for o in kept]
    return sorted(rows, key=lambda row: (ROBOTS.index(row.robot), row.label.count(","), row.label))


def in_words(cell: Cell) -> str:
    """Say what a cell trains, but for its robot.

    Example:
        >>> in_words(Cell("mechanisms", "ppo", "logit-normal", "Hopper", variant="matched-noise"))
        'PPO, logit-normal, start at noise 0.4'
    """
    start = {"equal": "equal start", "as-they-come": "usual start, fresh seeds"}.get(cell.arm, "")
    return ", ".join(
        filter(None, [cell.algorithm.upper(), NAMES[cell.family], start, change_name(cell.variant)])
    )


def _gains(outcome: Outcome) -> dict[str, Estimate]:
    return {way: gain(outcome.ways[way], outcome.ways["median"]) for way in WAYS}


def gain(returns: NDArray[np.float64], median: NDArray[np.float64]) -> Estimate:
    """Return what a way to act earns less the median, in percent of the median's return: a mean over seeds.

    Args:
        returns: `[S]` mean return of each seed by that way; NaN for a diverged seed, which is left out.
        median: `[S]` the same by the median, from the same starts.

    Example:
        >>> estimate = gain(np.array([90.0, 99.0]), np.array([100.0, 100.0]))
        >>> round(float(estimate.value), 1)
        -5.5
    """
    unit = np.nanmean(np.abs(median)) / 100
    generator = np.random.default_rng(0)
    options: dict[str, Any] = {"statistic": "mean", "paired": True, "missing": "exclude"}
    return difference(returns / unit, median / unit, generator, resamples=MANY_RESAMPLES, **options)


@dataclass(frozen=True)
class Counts:
    """In how many cells a way to act is found below the median, or above it.

    Made by `count`, which has an example.
    """

    below: int
    above: int
    cells: int
    """All that were compared."""
    robots_below: tuple[str, ...]
    robots_above: tuple[str, ...]
    least: float
    """The smallest loss among those below, in % of the median's return; NaN where there is none."""
    most: float
    """The largest."""

    @property
    def told(self) -> str:
        """What is counted, in words."""
        left = self.cells - self.above - self.below
        return f"above in {self.above} of {self.cells}, below in {self.below}, no difference found in {left}"


def count(rows: Sequence[Row], way: str) -> Counts:
    """Count the rows in which a way to act is found below the median, or above it (`Row.found`).

    Args:
        rows: as `rows_of` returns them.
        way: a key of their gains.

    Example:
        >>> gains = {"mode": Estimate(-3.0, -5.0, -1.0, 10, 0, 0.95, "difference of means")}
        >>> count([Row("Ant", "PPO, Beta", "beta", gains)], "mode")  # doctest: +NORMALIZE_WHITESPACE
        Counts(below=1, above=0, cells=1, robots_below=('Ant',), robots_above=(), least=3.0, most=3.0)
    """
    below, above = ([row for row in rows if row.found(way) == sign] for sign in (-1, 1))
    losses = [-float(row.gains[way].value) for row in below] or [float("nan")]
    robots = [tuple(dict.fromkeys(row.robot for row in found)) for found in (below, above)]
    return Counts(len(below), len(above), len(rows), robots[0], robots[1], min(losses), max(losses))


def draw(rows: Sequence[Row], ways: Mapping[str, str] = WAYS) -> Figure:
    """Draw a row for each cell under the name of its robot, and a panel for each way to act.

    Args:
        rows: as `rows_of` returns them.
        ways: to act, keys of the rows' gains, and the panels' titles.

    Example:
        >>> gain = Estimate(-3.0, -5.0, -1.0, 10, 0, 0.95, "difference of means")
        >>> fig = draw([Row("Ant", "PPO, Beta", "beta", dict.fromkeys(WAYS, gain))])
        >>> [label.get_text() for label in fig.axes[0].get_yticklabels()]
        ['Ant', 'PPO, Beta']
        >>> plt.close(fig)
    """
    lines: list[Row | str] = []
    for robot in dict.fromkeys(row.robot for row in rows):
        lines += [robot, *(row for row in rows if row.robot == robot)]
    size = (WIDTH, 1.1 + _ROW_HEIGHT * len(lines))
    fig, axes = plt.subplots(1, len(ways), sharex=True, sharey=True, figsize=size, squeeze=False)
    for ax, (way, title) in zip(axes.flat, ways.items(), strict=True):
        for place, row in enumerate(lines):
            if isinstance(row, Row):
                gain, look = row.gains[way], LOOKS[row.family]
                reach = [[gain.value - gain.low], [gain.high - gain.value]]
                ax.errorbar(gain.value, place, xerr=reach, fmt=look.marker, color=look.color, markersize=5)
        ax.axvline(0, color="#8a8f98", linewidth=1, linestyle=":")
        ax.set_title(title)
    first = axes.flat[0]
    names = [row.label if isinstance(row, Row) else row for row in lines]
    first.set_yticks(range(len(lines)), names, fontsize=10)
    first.set_ylim(len(lines) - 0.4, -0.6)
    for label, row in zip(first.get_yticklabels(), lines, strict=True):
        label.set_fontweight("normal" if isinstance(row, Row) else "bold")
    fig.supxlabel("return minus the median's [% of the median's]")
    return fig
