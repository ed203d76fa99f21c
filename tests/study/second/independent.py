"""The second study's primary comparison once more, by other means: written from the protocol's text alone.

Nothing here comes from `inbounds`. Cells are read with pyarrow and known by their metadata, the yardsticks are read
out of the table in `results/PROTOCOL-2.md`, and the statistics (`independent_statistics.py`) use NumPy, SciPy and one
generator of their own. `test_independent.py` holds the package's analysis against it.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
import pyarrow.parquet as pq
from numpy.typing import NDArray

from tests.study.second.independent_statistics import (
    Array,
    bootstrap_difference,
    expanded_share,
    holm,
    improvement,
    iqm,
    permutation_p,
)

PROTOCOL = Path(__file__).resolve().parents[3] / "results" / "PROTOCOL-2.md"
ROBOTS = ("HalfCheetah", "Hopper", "Swimmer", "Walker2d", "Ant", "Humanoid")
ENDPOINTS = ("final", "area")
LAWS = ("logit-normal", "beta")  # each against the Gaussian with a free σ
TWENTY = tuple(range(10, 30))
EPOCHS, LAST = 500, 50
RESAMPLES, PERMUTATIONS = 100_000, 99_999


class Yardstick(NamedTuple):
    """A row of the protocol's table."""

    nothing: float
    untrained: float
    best_final: float
    best_area: float
    margin_final: float
    margin_area: float


def yardsticks(text: str | None = None) -> dict[str, Yardstick]:
    """Read the table of doing nothing, best returns and margins from the protocol."""
    rows = {}
    for line in (PROTOCOL.read_text(encoding="utf8") if text is None else text).splitlines():
        names = [part.strip() for part in line.strip().strip("|").split("|")]
        numbers = [re.fullmatch(r"[−-]?\d+(\.\d+)?", part) for part in names[1:]]
        if names[0] in ROBOTS and len(names) == 7 and all(numbers):
            rows[names[0]] = Yardstick(*(float(part.replace("−", "-")) for part in names[1:]))
    assert set(rows) == set(ROBOTS)
    return rows


class Column(NamedTuple):
    """What cells share that differ by robot and seeds alone."""

    block: str
    """B, C, D, E or F."""
    algorithm: str
    law: str
    free: bool
    """σ does not depend on the state."""
    noise: float | None
    """Executed standard deviation asked for at the start; None: as it comes."""
    rate: float


GAUSSIAN_FREE = Column("B", "ppo", "gaussian", True, 0.4, 3e-4)
BOUNDED = {law: Column("B", "ppo", law, False, 0.4, 3e-4) for law in LAWS}
BLOCKS = {"as-they-come": "D", "noise": "E", "steps": "F"}


@dataclass(frozen=True)
class Runs:
    """All seeds of a column on a robot that are there, in the order of their seeds."""

    seeds: tuple[int, ...]
    returns: Array
    """`[seeds, epochs]`; NaN where no episode ended or the policy had diverged before."""
    diverged: NDArray[np.bool_]
    """`[seeds]`: sooner or later."""
    noise: Array
    """`[seeds]`: standard deviation of the executed actions in the first epoch."""
    saturation: Array
    """`[seeds]`: share of the executed actions at a bound in the first epoch."""

    def endpoint(self, name: str) -> Array:
        """Return the final return or the area of each seed; NaN for one that never had a return."""
        filled = repeated(self.returns)
        return (filled[:, -LAST:] if name == "final" else filled).mean(1)


def repeated(returns: Array) -> Array:
    """Repeat each row's last known return where one is missing, and the first known one before that.

    Example:
        >>> repeated(np.array([[np.nan, 1, np.nan, 3, np.nan]])).tolist()
        [[1.0, 1.0, 1.0, 3.0, 3.0]]
    """
    known = ~np.isnan(returns)
    epochs = np.broadcast_to(np.arange(returns.shape[1]), returns.shape)
    last = np.maximum.accumulate(np.where(known, epochs, -1), 1)
    return np.take_along_axis(returns, np.where(last < 0, known.argmax(1)[:, None], last), 1)


def read(folder: Path, seeds: tuple[int, ...] = TWENTY) -> dict[tuple[Column, str], Runs]:
    """Read the finished cells of the second study with these seeds below a results folder."""
    parts: dict[tuple[Column, str], list[Runs]] = {}
    for path in sorted((folder / "cells").glob("*.parquet")):
        about = json.loads(pq.read_schema(path).metadata[b"inbounds"])
        if about["study_version"] in (2, 3) and set(about["config"]["seeds"]) <= set(seeds):
            parts.setdefault((_column(about), about["robot"]), []).append(_runs(path, about["config"]))
    return {key: _together(runs) for key, runs in parts.items()}


def _column(about: dict[str, Any]) -> Column:
    config = about["config"]
    block = BLOCKS.get(about["arm"], "B" if config["algorithm_name"] == "ppo" else "C")
    policy, rate = config["policy"], config["algorithm"].get("learning_rate")
    free = not policy["state_dependent_std"]
    return Column(
        block, config["algorithm_name"], policy["family"], free, policy["initial_std"], rate or 3e-4
    )


def _runs(path: Path, config: dict[str, Any]) -> Runs:
    names = ["epoch", "seed", "return_mean", "diverged", "action_std", "saturation"]
    table = pq.read_table(path, columns=names)
    columns = {name: table[name].to_numpy() for name in names}
    order = np.lexsort((columns["epoch"], columns["seed"]))
    grid = {name: values[order].reshape(-1, EPOCHS) for name, values in columns.items()}
    seeds = tuple(int(seed) for seed in grid["seed"][:, 0])
    assert sorted(config["seeds"]) == list(seeds)
    assert (grid["epoch"] == np.arange(EPOCHS)).all()
    # The epoch in whose update a seed diverged was played before it: its return is in the file, and counts.
    gone, returns = grid["diverged"].astype(bool).any(1), grid["return_mean"].astype(float)
    first = [grid[name][:, 0].astype(float) for name in ("action_std", "saturation")]
    return Runs(seeds, returns, gone, *first)


def _together(parts: Sequence[Runs]) -> Runs:
    seeds = np.concatenate([part.seeds for part in parts])
    order = np.argsort(seeds)
    assert len(set(seeds.tolist())) == len(seeds)
    fields = ("returns", "diverged", "noise", "saturation")
    joined = {name: np.concatenate([getattr(part, name) for part in parts])[order] for name in fields}
    return Runs(tuple(seeds[order].tolist()), **joined)


# The primary comparison ----------------------------------------------------------------------------------------------

Verdict = Literal["refuted", "confirmed", "contradicted", "undecided"]


@dataclass(frozen=True)
class Row:
    """One of the 24 tests."""

    law: str
    endpoint: str
    robot: str
    seeds: tuple[int, int]
    diverged: tuple[int, int]
    """How many seeds of the bounded law and of the Gaussian."""
    margin: float
    difference: float = np.nan
    share: float = np.nan
    """Of the replicates, left out at each end."""
    low: float = np.nan
    high: float = np.nan
    p: float = np.nan
    p_holm: float = np.nan
    verdict: Verdict | None = None
    """None before all twenty seeds of both sides are there."""


def verdict_of(row: Row) -> Verdict:
    """Return a row's word."""
    return judged(row.low, row.high, row.difference, row.p_holm, row.margin)


def judged(low: float, high: float, difference: float, p_holm: float, margin: float) -> Verdict:
    """Return the protocol's word."""
    if -margin < low and high < margin:
        return "refuted"
    if p_holm < 0.05:
        return "confirmed" if difference > 0 else "contradicted"
    return "undecided"


def primary(
    folder: Path,
    *,
    without_diverged: bool = False,
    resamples: int = RESAMPLES,
    permutations: int = PERMUTATIONS,
    seed: int = 20260,
) -> list[Row]:
    """Return the 24 rows, laws outermost, then endpoints, then robots."""
    rng, cells, table = np.random.default_rng(seed), read(folder), yardsticks()
    rows: list[Row] = []
    for law, endpoint, robot in [(x, y, z) for x in LAWS for y in ENDPOINTS for z in ROBOTS]:
        sides = [cells.get((column, robot)) for column in (BOUNDED[law], GAUSSIAN_FREE)]
        x, y = (_counting(side, endpoint, without_diverged) for side in sides)
        gone = [0 if side is None else int(side.diverged.sum()) for side in sides]
        margin = table[robot].margin_final if endpoint == "final" else table[robot].margin_area
        row = Row(law, endpoint, robot, (len(x), len(y)), (gone[0], gone[1]), margin)
        if min(len(x), len(y)) > 1:
            share, replicates = expanded_share(x, y), bootstrap_difference(x, y, rng, resamples)
            low, high = np.quantile(replicates, [share, 1 - share])
            row = replace(row, difference=x.mean() - y.mean(), share=share, low=low, high=high)
        if all(side is not None and side.seeds == TWENTY for side in sides):
            row = replace(row, p=permutation_p(x, y, rng, permutations))
        rows.append(row)
    adjusted = holm(np.array([row.p for row in rows]))
    rows = [replace(row, p_holm=float(p)) for row, p in zip(rows, adjusted, strict=True)]
    return [row if np.isnan(row.p) else replace(row, verdict=verdict_of(row)) for row in rows]


def _counting(side: Runs | None, endpoint: str, without_diverged: bool) -> Array:
    """Return the endpoint of the seeds that count."""
    if side is None:
        return np.empty(0)
    values = side.endpoint(endpoint)
    return values[~(np.isnan(values) | (side.diverged & without_diverged))]


# The manipulation check and the aggregates ---------------------------------------------------------------------------


@dataclass(frozen=True)
class Manipulation:
    """What the untrained policies of a column did on a robot: means over seeds."""

    noise: float
    saturation: float
    first_return: float
    failed: bool
    """An equal start was asked for, and is missed by more than 0.02."""


def manipulations(folder: Path, *, more_seeds: bool = True) -> dict[tuple[Column, str], Manipulation]:
    """Return the check of each column and robot, over all their seeds or over 10 to 19 alone."""
    return {
        (column, robot): Manipulation(
            noise := float(runs.noise.mean()),
            float(runs.saturation.mean()),
            float(np.nanmean(runs.returns[:, 0])),
            column.noise is not None and abs(noise - column.noise) > 0.02,
        )
        for (column, robot), runs in read(folder, TWENTY if more_seeds else TWENTY[:10]).items()
    }


def scores(cells: dict[tuple[Column, str], Runs], column: Column, endpoint: str) -> list[Array] | None:
    """Return a column's normalised scores, one array per robot, or None where a robot is missing."""
    twenty = column in (GAUSSIAN_FREE, *BOUNDED.values())
    found = []
    for robot, yardstick in yardsticks().items():
        runs = cells.get((column, robot))
        if runs is None or runs.seeds != (TWENTY if twenty else TWENTY[:10]):
            return None
        values = runs.endpoint(endpoint)
        found.append(
            (values[~np.isnan(values)] - yardstick.nothing) / (yardstick.best_final - yardstick.nothing)
        )
    return found


class Aggregates(NamedTuple):
    """Over all six robots, of one endpoint."""

    iqm: dict[str, tuple[float, float, float]]
    """Of the primary columns, by law ("gaussian" is the one with a free σ): estimate and interval."""
    improvement: dict[str, tuple[float, float, float]]
    """Of the bounded law over the Gaussian with a free σ."""


def aggregates(folder: Path, endpoint: str, *, resamples: int = RESAMPLES, seed: int = 20261) -> Aggregates:
    """Return the aggregates of the primary columns that are complete."""
    rng, cells = np.random.default_rng(seed), read(folder)
    columns = {"gaussian": GAUSSIAN_FREE, **BOUNDED}
    whole = {law: s for law, column in columns.items() if (s := scores(cells, column, endpoint)) is not None}
    means = {law: iqm(groups, rng, resamples) for law, groups in whole.items()}
    pairs = [law for law in LAWS if law in whole and "gaussian" in whole]
    return Aggregates(
        means, {law: improvement(whole[law], whole["gaussian"], rng, resamples) for law in pairs}
    )
