"""A study that was never run: finished cells with made-up returns, in the format of real ones."""

from collections.abc import Iterable
from typing import Any

import numpy as np
import pyarrow as pa

from inbounds import learning
from inbounds.learning.storage.parquet import parquet_bytes
from inbounds.study import Cell, StudyFolder
from inbounds.study.grid import COMPARED
from inbounds.study.running.measure import MEASURE_EVERY
from inbounds.study.running.one_cell import RETURNS
from inbounds.study.running.provenance import provenance
from inbounds.study.store import cell_metadata, table_of

WAYS = ("mean", "median", "mode", "sample")


def level_of(cell: Cell) -> float:
    """Where a made-up cell's mean return ends: families, robots and variants differ."""
    place = (*COMPARED, "clipped-gaussian").index(cell.family)
    return (
        1000.0 + 250 * place + 100 * len(cell.robot) - 20 * len(cell.variant) - 300 * (cell.arm == "printed")
    )


def write_cells(
    folder: StudyFolder, cells: Iterable[Cell], *, diverged: tuple[int, ...] = (), noise: float = 150.0
) -> None:
    """Publish made-up results of cells; `diverged` names seeds by their place, which fail half-way."""
    for cell in cells:
        folder.publish(_contents(folder, cell, diverged, noise))


def _contents(folder: StudyFolder, cell: Cell, diverged: tuple[int, ...], noise: float) -> dict[Any, Any]:
    rng = np.random.default_rng([ord(letter) for letter in cell.id])
    num_seeds, half = len(cell.seeds), cell.epochs // 2
    gone = np.isin(np.arange(num_seeds), diverged)
    ends = level_of(cell) + noise * rng.normal(size=num_seeds)
    records, measurements = [], []
    for e in range(cell.epochs):
        growth = 1 - np.exp(-5 * e / cell.epochs)
        returns = -20 + (ends + 20) * growth + 0.3 * noise * rng.normal(size=num_seeds)
        records.append(
            {"epoch": e, "env_steps": 2048 * (e + 1), "seconds": 1.2, "episodes": np.full(num_seeds, 2)}
            | {"return_mean": returns, "diverged": gone & (e >= half)}
        )
        if e == 0 or (e + 1) % MEASURE_EVERY == 0:
            measurements.append(_measured(cell, e, np.where(gone & (e >= half), np.nan, 1.1 * returns), rng))
    about = {"sessions": [provenance() | {"from_epoch": 0}], "greedy": "median"}
    about |= {"seconds": {"training": 600.0, "evaluation": 20.0, "final evaluation": 9.0, "total": 635.0}}
    about |= {"first_rewards": np.zeros((num_seeds, 16)).tolist()}
    table = table_of(cell.config, records, measurements)
    contents: dict[Any, Any] = {}
    if cell.keeps_policies:
        policies, returned = folder.policy_files(cell)
        rows = [
            {"seed": seed, "greedy": way, "episode": episode, "length": 1000, "return": value}
            for i, way in enumerate(WAYS)
            for seed, end in zip(cell.seeds, ends, strict=True)
            for episode, value in enumerate(end + 10 * i + rng.normal(size=10))
        ]
        contents[policies] = b"no policies"
        contents[returned] = parquet_bytes(
            pa.Table.from_pylist(rows, RETURNS), cell_metadata(cell, cell.config)
        )
    contents[folder.cell_file(cell)] = parquet_bytes(table, cell_metadata(cell, cell.config, **about))
    return contents


def _measured(cell: Cell, epoch: int, greedy: Any, rng: np.random.Generator) -> dict[str, Any]:
    numbers, law = 1 + rng.random((len(cell.seeds), 20, 3)), learning.FAMILIES[cell.family].law
    names = ["entropy", "kl", "approx_kl", "explained_variance", "action_std", "saturation"]
    names += ["clip_fraction"] if cell.algorithm == "ppo" else ["accepted", "step_fraction"]
    return (
        {"epoch": epoch, "greedy_return": greedy, "evaluation_seconds": 0.5}
        | {name: rng.random(len(cell.seeds)) for name in names}
        | law.describe(law.named(numbers, numbers), cell.config.policy.limits)
    )
