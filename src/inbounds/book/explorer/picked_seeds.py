"""Pick your own seeds: what a report of a few would have said, beside the study's ten and beside all other reports.

    picked_seeds(study_pages.shipped())

The page holds the final return of every seed and the study's own differences. What a few seeds say is computed in the
reader's browser (`picked_seeds.js`), and tested against `reports` of this module: difference of means, Welch's
interval, and the same for *every* way to take so many seeds a side, enumerated, not drawn.
"""

from __future__ import annotations

import base64
import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

from inbounds.book.drawing import figures
from inbounds.book.drawing.alt_text import svg_bytes
from inbounds.book.explorer.assets import carried_scripts, style_sheet
from inbounds.book.explorer.choices import verdict
from inbounds.book.report import as_they_come
from inbounds.book.report.as_they_come import Compared
from inbounds.book.report.html import NONE_FINISHED
from inbounds.book.report.study_figures import SHORT
from inbounds.book.report.words import ALGORITHMS
from inbounds.book.templates import macros, script_json
from inbounds.study.analysis import scores
from inbounds.study.grid import ROBOTS
from inbounds.study.outcomes import Outcomes
from inbounds.study.statistics.comparisons import welch_freedom
from inbounds.study.words import percent, spoken

ELEMENT = "inbounds-picked-seeds"
FIRST = ("HalfCheetah", "ppo", ("logit-normal", "beta"))
"""Robot, algorithm and pair until the reader chooses; the first finished one where this is not."""
TICKED = 3
"""Seeds a side that are ticked at first."""


@dataclass(frozen=True)
class Reports:
    """Every report that a choice of seeds allows: the difference of means with Welch's interval.

    Made by `reports`, which has an example.
    """

    value: NDArray[np.float64]
    """Difference of the means `[A, B]`, by the choices of both sides."""
    low: NDArray[np.float64]
    """Lower ends `[A, B]`."""
    high: NDArray[np.float64]
    """Upper ends `[A, B]`."""

    def shares(self) -> dict[str, dict[str, float]]:
        """Share of the reports that say higher, lower and neither: by the means alone, and by the interval."""
        means, found = np.sign(self.value), np.sign(self.low).clip(0) + np.sign(self.high).clip(max=0)
        return {
            rule: {
                word: float((sides == side).mean())
                for word, side in (("higher", 1), ("lower", -1), ("nothing", 0))
            }
            for rule, sides in (("means", means), ("interval", found))
        }


def reports(first: ArrayLike, second: ArrayLike, picked: tuple[int, int] = (TICKED, TICKED)) -> Reports:
    """Return what every way to take a few seeds of each side would report.

    Args:
        first: one result per seed.
        second: likewise.
        picked: how many of the first and of the second, at least two each.

    Raises:
        ValueError: fewer than two seeds of a side: there is no interval.

    Example:
        >>> every = reports(range(10), range(10))
        >>> every.value.shape, round(every.shares()["interval"]["nothing"], 2)
        ((120, 120), 0.98)
    """
    if min(picked) < 2:
        raise ValueError(f"{picked} seeds: an interval needs at least two a side")
    sides = [
        np.array(list(itertools.combinations(np.asarray(side, float), count)))
        for side, count in zip((first, second), picked, strict=True)
    ]
    a, b = (side.var(axis=1, ddof=1) / side.shape[1] for side in sides)
    parts = a[:, None], b[None, :]  # [A, 1], [1, B]
    value = sides[0].mean(axis=1)[:, None] - sides[1].mean(axis=1)
    reach = stats.t.ppf(0.975, welch_freedom(parts, picked)) * np.sqrt(sum(parts))
    return Reports(value, value - reach, value + reach)


def pairs(outcomes: Outcomes) -> Iterator[tuple[Compared, list[NDArray[np.float64]]]]:
    """Yield the finished differences from the usual starts, final return, each with the results of both sides.

    Example:
        >>> from pathlib import Path
        >>> from inbounds.study.store import StudyFolder
        >>> list(pairs(Outcomes.read(StudyFolder(Path("no/results")))))
        []
    """
    for arm in ("standard", "beyond"):
        for row in as_they_come.compared(outcomes, arm, ["final"]):
            cells = [outcomes.find(column, row.robot) for column in row.contrast.columns]
            yield row, [scores(cell, "final") for cell in cells if cell is not None]


@dataclass(frozen=True)
class PickedSeeds:
    """Pick your own seeds, in the reader's browser; a stored notebook keeps a few words.

    Made by `picked_seeds`, which has an example.
    """

    data: dict[str, Any]
    """Results, pairs and names, ready for JSON."""
    static: str
    """HTML that stands there without JavaScript and in print."""

    def __repr__(self) -> str:
        """Return a line that never changes."""
        return "<study: pick your own seeds>"

    def _repr_html_(self) -> str:
        if not self.data["rows"]:
            return self.static
        return str(
            macros("picked_seeds").element(
                script_json(self.data), self.static, style_sheet(ELEMENT), carried_scripts(ELEMENT)
            )
        )


def picked_seeds(outcomes: Outcomes) -> PickedSeeds:
    """Return the results of every seed to pick from.

    Args:
        outcomes: of the first study, as `study_pages.shipped` reads them.

    Example:
        >>> from pathlib import Path
        >>> from inbounds.study.store import StudyFolder
        >>> picked_seeds(Outcomes.read(StudyFolder(Path("no/results"))))
        <study: pick your own seeds>
    """
    known = list(pairs(outcomes))
    known.sort(key=lambda each: _place(each[0]) != FIRST)  # the first choice leads, the rest as it was
    results: dict[str, list[float]] = {}
    rows = []
    for row, sides in known:
        for family, values in zip(row.contrast[2:], sides, strict=True):
            key = f"{row.robot}-{row.contrast.algorithm}-{family}"
            results[key] = [round(float(x), 1) for x in values if np.isfinite(x)]
        robot, algorithm, pair = _place(row)
        told = f"{spoken(row.difference)} points: {verdict(row, brief=True)}"
        value = float(row.difference.value)
        rows.append({"robot": robot, "algorithm": algorithm, "pair": pair, "told": told, "value": value})
    data = {
        "robots": [robot for robot in ROBOTS if any(row["robot"] == robot for row in rows)],
        "algorithms": list(ALGORITHMS),
        "families": {family: SHORT[family] for family in figures.LOOKS},
        "results": results,
        "rows": rows,
        "ticked": TICKED,
    }
    return PickedSeeds(data, _static(*known[0]) if known else NONE_FINISHED)


def _place(row: Compared) -> tuple[str, str, tuple[str, str]]:
    return row.robot, row.contrast.algorithm, (row.contrast.first, row.contrast.second)


def _static(row: Compared, sides: Sequence[NDArray[np.float64]]) -> str:
    """Return the differences of all reports as a picture, and their shares in words."""
    first, second = (side[np.isfinite(side)] for side in sides)
    every = reports(first, second)
    names = [SHORT[family] for family in row.contrast[2:]]
    whole = f"all {' and '.join(map(str, dict.fromkeys((len(first), len(second)))))} seeds"
    with figures.use_style():
        fig, ax = plt.subplots(figsize=(figures.WIDTH, 2.8))
        ax.hist(every.value.ravel(), bins=41, histtype="stepfilled", color="#5F6770")
        ax.axvline(0, color="#22272D", linewidth=1)
        ax.axvline(float(row.difference.value), color="#A8330A", label=whole)
        ax.set(xlabel=f"{names[0]} − {names[1]}, difference of means [points]", ylabel="reports")
        ax.legend(loc="upper left")
    picture = base64.b64encode(svg_bytes(fig)).decode("ascii")
    plt.close(fig)
    shares = every.shares()
    told = "; ".join(
        f"{rule} it is higher in {percent(shares[key]['higher'])}, lower in {percent(shares[key]['lower'])}"
        for key, rule in (("means", "by the two means"), ("interval", "by Welch's 95 % interval"))
    )
    caption = (
        f"The differences that all {every.value.size} ways to take {TICKED} seeds of each family report, "
        f"{names[0]} minus {names[1]} on {row.robot} under {row.contrast.algorithm.upper()}: {told}."
    )
    alt = f"Histogram of the differences, with a line at that of {whole}."
    return str(macros("picked_seeds").static(picture, alt, caption))


__all__ = ["FIRST", "TICKED", "PickedSeeds", "Reports", "pairs", "picked_seeds", "reports"]
