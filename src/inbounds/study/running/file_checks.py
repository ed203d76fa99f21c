"""What the files of a finished cell must hold: columns, rows and policies, beyond what checksums can say.

A file can be whole, listed with its own checksum, and wrong. Each function returns what is wrong in a few words, empty
where nothing is.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa

from inbounds.learning import FAMILIES, Limits, load_policies
from inbounds.learning.storage.stored_config import changed_fields, describe
from inbounds.study import store
from inbounds.study.grid import Cell
from inbounds.study.running.evaluate import FINAL_EPISODES
from inbounds.study.running.measure import MEASURE_EVERY

_OF_EVERY_CELL = ("greedy_return", "evaluation_seconds", "entropy", "kl", "approx_kl", "explained_variance")
_OF_ALGORITHM = {"ppo": ("clip_fraction",), "trpo": ("accepted", "step_fraction")}


def columns_of(cell: Cell) -> tuple[str, ...]:
    """Return the columns of a cell's rows, in the order of `store.COLUMNS`.

    Example:
        >>> columns_of(Cell("test", "trpo", "beta", "Hopper"))[-3:]
        ('beta_q99', 'at_alpha_max', 'at_beta_max')
    """
    law, one = FAMILIES[cell.family].law, np.ones((1, 1, 1))
    measured = {*_OF_EVERY_CELL, *_OF_ALGORITHM[cell.algorithm], "action_std", "saturation"}
    measured |= law.describe(law.named(*(one for _ in law.named.names())), Limits()).keys()
    return tuple(name for name in store.COLUMNS if name in store.EVERY_EPOCH or name in measured)


def wrong_rows(cell: Cell, table: pa.Table) -> str:
    """Return what is wrong with the rows of a cell: one per epoch and seed, with all columns of the cell.

    Example:
        >>> from inbounds.study import select
        >>> cell, = select(["standard-hopper-ppo-beta"])
        >>> rows = store.read_cell("results/cells/standard-hopper-ppo-beta.parquet")
        >>> wrong_rows(cell, rows), wrong_rows(cell, rows.drop_columns(["kl"]))
        ('', 'column kl is missing')
    """
    expected = columns_of(cell)
    for name in dict.fromkeys([*expected, *table.column_names]):
        if name not in table.column_names:
            return f"column {name} is missing"
        if name not in expected:
            return f"column {name} does not belong to it"
        if table.schema.field(name).type != store.COLUMNS[name][0]:
            return f"column {name} is of the type {table.schema.field(name).type}"
    if table.num_rows != cell.epochs * len(cell.seeds):
        return f"{table.num_rows} rows instead of {cell.epochs * len(cell.seeds)}"
    rows = zip(table["epoch"].to_pylist(), table["seed"].to_pylist(), strict=True)
    planned = ((epoch, seed) for epoch in range(cell.epochs) for seed in cell.seeds)
    for found, due in zip(rows, planned, strict=True):
        if found != due:
            return f"a row of epoch {found[0]}, seed {found[1]} where epoch {due[0]}, seed {due[1]} is due"
    epochs = np.arange(table.num_rows) // len(cell.seeds)
    due = (epochs == 0) | ((epochs + 1) % MEASURE_EVERY == 0)
    for name in expected:
        measured = table[name].is_valid().to_numpy()
        if not (measured == (due if name in store.MEASURED else True)).all():
            return f"column {name} has values where none are due, or lacks some"
    return ""


def wrong_returns(cell: Cell, table: pa.Table) -> str:
    """Return what is wrong with the returns of a cell's final policies: each seed, way to act and episode once."""
    names = ("greedy", "seed", "episode", "return", "length")
    if missing := [name for name in names if name not in table.column_names]:
        return f"column {missing[0]} is missing"
    rows = list(zip(*(table[name].to_pylist() for name in names[:3]), strict=True))
    ways = (*FAMILIES[cell.family].greedy, "sample")
    planned = [(way, seed, e) for way in ways for seed in cell.seeds for e in range(FINAL_EPISODES)]
    if rows != planned:
        return f"{len(rows)} rows that are not {', '.join(ways)} × {len(cell.seeds)} seeds × {FINAL_EPISODES} episodes"
    return ""


def wrong_policies(cell: Cell, path: Path) -> str:
    """Return what is wrong with the file of a cell's final policies: it must be whole, and of this configuration."""
    try:
        policies = load_policies(path)
    except (ValueError, KeyError, IndexError, RuntimeError) as error:
        return str(error).partition(": ")[0]
    if different := changed_fields(cell.kept_config, describe(policies[0].config)):
        name, (there, here) = next(iter(different.items()))
        return f"these are policies of another configuration ({name} is {there!r} instead of {here!r})"
    return ""
