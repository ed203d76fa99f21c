"""What the shipped policies earn by other ways to act: `results/evaluations`, one Parquet file a cell.

    results/evaluations/ID.parquet        one row per way to act, seed and episode; `COLUMNS` is the schema
    results/evaluations/nothing.parquet   what robots earn that are left alone

`inbounds study evaluate` writes them (`inbounds.study.running.play_ways`). Beside mean, median, mode and sample of a
policy's law there are its *bang-bang* twins: each component of the action is moved to the nearer of its two bounds
(Seyde et al. 2021), the median's or a sample's.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from inbounds.learning import FAMILIES
from inbounds.learning.storage.whole_files import DamagedFileError, damaged
from inbounds.study import store
from inbounds.study.grid import ROBOTS, Cell
from inbounds.study.store import StudyFolder

Floats = NDArray[np.float64]

SNAPPED: Mapping[str, str] = {"median-snapped": "median", "sample-snapped": "sample"}
"""Bang-bang ways to act, and whose action is moved to the nearer bound."""
NOTHING = "nothing"
"""The middle of the box in every state: no torque."""
QUANTILES = (5, 25, 50, 75, 95)
EPISODES: Mapping[str, int] = {robot: 3 if robot in ("Ant", "Humanoid") else 10 for robot in ROBOTS}
"""Episodes of each seed: the final evaluation's ten starts, of the robots that pay for contacts, which take longest
to simulate, the first three. Fixed before anything was played."""
FIRST_STEPS = 16
"""Env steps whose rewards are kept, to compare with on other machines."""

COLUMNS: Mapping[str, tuple[pa.DataType, str]] = {
    "seed": (pa.int32(), "the seed that was trained"),
    "way": (pa.string(), "to act: mean, median, mode, sample, median-snapped or sample-snapped"),
    "episode": (pa.int32(), "0, 1, …: which of the seed's starts"),
    "return": (pa.float64(), "undiscounted return; NaN for a diverged seed"),
    "length": (pa.int32(), "env steps"),
    "first_reward": (
        pa.float64(),
        f"reward of the first {FIRST_STEPS} env steps, before chaos can have grown",
    ),
    **{
        f"abs_q{q:02}": (
            pa.float32(),
            f"{q} % quantile of |action|, in units of half the range, over steps and motors",
        )
        for q in QUANTILES
    },
    "at_bounds": (pa.float32(), "share of action components within 0.1 % of a bound"),
    "reversals": (pa.float32(), "share of action components of another sign than in the step before"),
}
"""Column → type and meaning."""
_OF_NOTHING = ("seed", "episode", "return", "length", "first_reward")


class Played(NamedTuple):
    """What a cell's policies did by one way to act.

    Made by `read_ways`, which has an example.
    """

    returns: Floats
    """`[S, E]` undiscounted."""
    lengths: Floats
    """`[S, E]` env steps."""
    actions: Mapping[str, Floats]
    """`[S, E]` by the names of the columns that describe actions: `abs_q05` to `abs_q95`, `at_bounds`, `reversals`."""


def ways_of(family: str) -> tuple[str, ...]:
    """Return the ways to act that are played: one of those that are the same by definition, and the bang-bang twins.

    Example:
        >>> ways_of("gaussian")
        ('median', 'sample', 'median-snapped', 'sample-snapped')
        >>> ways_of("beta")
        ('mean', 'median', 'mode', 'sample', 'median-snapped', 'sample-snapped')
    """
    same = {"gaussian": ("mean", "mode"), "clipped-gaussian": ("mode",)}.get(family, ())
    return (*(way for way in FAMILIES[family].greedy if way not in same), "sample", *SNAPPED)


def evaluation_file(folder: StudyFolder, cell: Cell) -> Path:
    """Return the path of what a cell's policies earned."""
    return folder.results / "evaluations" / f"{cell.id}.parquet"


def nothing_file(folder: StudyFolder) -> Path:
    """Return the path of what robots earn that are left alone."""
    return folder.results / "evaluations" / f"{NOTHING}.parquet"


def evaluated(folder: StudyFolder, cells: Iterable[Cell]) -> tuple[Cell, ...]:
    """Return the cells whose policies have been played."""
    return tuple(cell for cell in cells if evaluation_file(folder, cell).is_file())


def read_ways(folder: StudyFolder, cell: Cell) -> dict[str, Played]:
    """Read what a cell's policies earned by each way to act.

    Args:
        folder: of the study.
        cell: whose policies.

    Raises:
        FileNotFoundError: they have not been played.
        DamagedFileError: the file is damaged, its rows are not those of the cell, or other policies were played.

    Example:
        >>> from inbounds.study import select
        >>> cell, = select(["standard-hopper-ppo-beta"])
        >>> ways = read_ways(StudyFolder(), cell)  # in the project's folder
        >>> ways["median-snapped"].returns.shape
        (10, 10)
        >>> bool((ways["median-snapped"].actions["at_bounds"] == 1).all())
        True
    """
    path = evaluation_file(folder, cell)
    table = store.read_cell(path)
    if said := wrong_ways(cell, table):
        raise damaged(path, said, store.restore(path))
    if said := other_policies(folder, cell):
        raise DamagedFileError(said)
    names, shape = table["way"].to_pylist(), (len(cell.kept_seeds), EPISODES[cell.robot])
    found = {}
    for way in ways_of(cell.family):
        mine = np.array([name == way for name in names])
        columns = {
            name: np.asarray(table[name].to_numpy()[mine], np.float64).reshape(shape)
            for name in COLUMNS
            if name not in ("seed", "way", "episode")
        }
        actions = {name: columns[name] for name in columns if name.startswith("abs_q")}
        actions |= {name: columns[name] for name in ("at_bounds", "reversals")}
        found[way] = Played(columns["return"], columns["length"], actions)
    return found


def read_nothing(folder: StudyFolder) -> dict[str, Floats]:
    """Read what robots earn that are left alone: returns `[S, E]` by robot, from the starts of seeds 0 to 9.

    Example:
        >>> nothing = read_nothing(StudyFolder())  # in the project's folder
        >>> nothing["Ant"].shape, bool((nothing["Ant"] > 800).all())  # a point a step for not lying on its back
        ((10, 3), True)
    """
    table = store.read_cell(nothing_file(folder))
    robots = np.array(table["robot"].to_pylist())
    returns = table["return"].to_numpy()
    return {
        robot: returns[robots == robot].reshape(-1, EPISODES[robot])
        for robot in dict.fromkeys(robots.tolist())
    }


def other_policies(folder: StudyFolder, cell: Cell) -> str:
    """Return why a cell's evaluation is not one of the policies that are there; empty where it is.

    Raises:
        FileNotFoundError: they have not been played.
        DamagedFileError: the file is damaged.
    """
    path, policies = evaluation_file(folder, cell), folder.policy_files(cell)[0]
    metadata = store.read_metadata(path, "policies", "session")
    return of_others(path, policies, metadata["policies"] if store.is_of(cell, metadata) else "")


def of_others(path: Path, policies: Path, played: str) -> str:
    """Return why a file is not of the policies that are there; empty where it is.

    Args:
        path: of what was made of policies.
        policies: where they are.
        played: SHA-256 of those it was made of.
    """
    if not policies.is_file():
        return f"{policies} is missing: {store.restore(policies)}"
    if played != store.sha256(policies):
        return f"{path} is of other policies than {policies}: {store.make(path)}"
    return ""


def wrong_ways(cell: Cell, table: pa.Table) -> str:
    """Return what is wrong with the rows of a cell's evaluation, the first thing; empty where nothing is.

    Example:
        >>> from inbounds.study import select
        >>> cell, = select(["standard-hopper-ppo-beta"])
        >>> rows = store.read_cell(evaluation_file(StudyFolder(), cell))  # in the project's folder
        >>> wrong_ways(cell, rows), wrong_ways(cell, rows.drop_columns(["return"]))
        ('', 'column return is missing')
    """
    for name, (kind, _) in COLUMNS.items():
        if name not in table.column_names:
            return f"column {name} is missing"
        if table.schema.field(name).type != kind:
            return f"column {name} is of the type {table.schema.field(name).type}"
    rows = list(zip(*(table[name].to_pylist() for name in ("way", "seed", "episode")), strict=True))
    ways, episodes = ways_of(cell.family), EPISODES[cell.robot]
    if rows != [(way, seed, e) for way in ways for seed in cell.kept_seeds for e in range(episodes)]:
        return f"{len(rows)} rows that are not {', '.join(ways)} × {len(cell.kept_seeds)} seeds × {episodes} episodes"
    return ""


def schema(names: Iterable[str] = tuple(COLUMNS)) -> pa.Schema:
    """Return the schema of some columns; each says what it means."""
    return pa.schema(
        [
            pa.field(name, COLUMNS[name][0], nullable=False, metadata={"meaning": COLUMNS[name][1]})
            for name in names
        ]
    )


def nothing_schema() -> pa.Schema:
    """Return the schema of `nothing_file`."""
    return schema(_OF_NOTHING).insert(0, pa.field("robot", pa.string(), nullable=False))


def summary(actions: NDArray[Any], length: int) -> dict[str, float]:
    """Describe the actions of an episode by the columns that do so.

    Args:
        actions: `[T, A]` executed, in units of half the range.
        length: env steps of the episode, at most T; what comes after is another episode's.

    Returns:
        Numbers; NaN where the policy gave some.

    Example:
        >>> found = summary(np.array([[1.0], [-1.0], [0.2], [9.0]]), length=3)
        >>> round(found["at_bounds"], 2), found["reversals"], found["abs_q50"]
        (0.67, 1.0, 1.0)
    """
    mine = actions[:length]
    if not np.isfinite(mine).all():  # of a diverged seed
        return dict.fromkeys([*(f"abs_q{q:02}" for q in QUANTILES), "at_bounds", "reversals"], float("nan"))
    size = np.abs(mine)
    quantiles = np.quantile(size, np.array(QUANTILES) / 100)
    signs = np.sign(mine)
    return {
        **{f"abs_q{q:02}": float(value) for q, value in zip(QUANTILES, quantiles, strict=True)},
        "at_bounds": float(np.mean(size >= 0.999)),
        "reversals": float(np.mean(signs[1:] != signs[:-1])) if length > 1 else 0.0,
    }
