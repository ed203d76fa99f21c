"""Running the map: cell by cell, each kept whole as it ends; all of it packed into one file at last.

runs/dial/ID.parquet        the rows of one finished cell
results/dial/map.parquet    all cells: one row per cell, seed and epoch; metadata says what it ran on
results/dial/checksums.txt  its SHA-256, as `sha256sum --check` reads it
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import shlex
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from inbounds.learning import Trainer, train
from inbounds.learning.storage.parquet import about_of, parquet_bytes, read_about, read_table
from inbounds.learning.storage.stored_config import changed_fields, describe
from inbounds.learning.storage.whole_files import damaged, held, write_whole
from inbounds.study.dial.cells import DialCell, dial_cells
from inbounds.study.dial.task import DialEnv
from inbounds.study.running.provenance import provenance
from inbounds.study.store import ROOT

MEASURED = ("score", "saturation", "action_std", "kl")
RAN_ON = ("commit", "engine", "versions", "processor")
REMEDY = "delete it, and run the command again"


@dataclass(frozen=True)
class DialFolder:
    """Where the map is, and where its cells lie until it is whole.

    Example:
        >>> DialFolder().map_file.as_posix()
        'results/dial/map.parquet'
    """

    results: Path = Path("results/dial")
    work: Path = Path("runs/dial")

    @classmethod
    def shipped(cls) -> DialFolder:
        """Return the folders of the map that the project ships, wherever Python was started."""
        return cls(ROOT / "results" / "dial", ROOT / "runs" / "dial")

    @property
    def map_file(self) -> Path:
        """The file of all cells."""
        return self.results / "map.parquet"

    @property
    def sum_file(self) -> Path:
        """The checksum of the map."""
        return self.results / "checksums.txt"

    def cell_file(self, cell: DialCell) -> Path:
        """Return the path of a finished cell's rows."""
        return self.work / f"{cell.id}.parquet"

    def finished(self, cell: DialCell) -> bool:
        """Return whether a cell's rows are there, of this configuration."""
        path = self.cell_file(cell)
        if not path.is_file():
            return False
        try:
            return is_of(cell, self.about(cell)["config"])
        except (AttributeError, KeyError, TypeError) as error:  # it has a configuration of something else
            raise damaged(path, error, REMEDY) from error

    def about(self, cell: DialCell) -> dict[str, Any]:
        """Return what a finished cell's file says of itself."""
        keys = {"config", "seconds", *RAN_ON}
        return read_about(self.cell_file(cell), REMEDY, keys)

    def read(self) -> pa.Table:
        """Read the map, after comparing it with its checksum.

        Raises:
            FileNotFoundError: the map has not been made.
            DamagedFileError: it is not the file that its checksum belongs to.
        """
        if not self.map_file.is_file():
            raise FileNotFoundError(
                f"there is no {self.map_file}: go to the source tree, which has one, or name its folder with "
                "--results, or make it (inbounds study dial run)"
            )
        folder = shlex.quote(str(self.results))
        remedy = f"restore both (git checkout -- {folder}), or make them again (inbounds study dial run)"
        line = self.sum_file.read_text() if self.sum_file.is_file() else ""
        if line.split()[:1] != [hashlib.sha256(self.map_file.read_bytes()).hexdigest()]:
            raise damaged(self.map_file, f"{self.sum_file.name} does not list it", remedy)
        return read_table(self.map_file, remedy)


def plain(cell: DialCell) -> dict[str, Any]:
    """Return a cell's configuration and task, as JSON gives them back."""
    task = vars(cell.task)
    found: dict[str, Any] = json.loads(json.dumps({**describe(cell.config), "task": task}))
    return found


def is_of(cell: DialCell, stored: dict[str, Any]) -> bool:
    """Return whether a stored `plain` is a cell's; an option that is not named there had its default."""
    config = {name: value for name, value in stored.items() if name != "task"}
    return stored["task"] == vars(cell.task) and not changed_fields(cell.config, config)


def run_cell(cell: DialCell) -> pa.Table:
    """Train a cell and return its rows, epoch by epoch and seed by seed.

    Args:
        cell: which.

    Returns:
        Columns `cell`, `epoch`, `seed` and those of `MEASURED`; a seed that has diverged has NaN.

    Example:
        >>> table = run_cell(DialCell("gaussian", 0.5, seeds=(900, 901), epochs=1))
        >>> table.num_rows, table.column_names[:3]
        (2, ['cell', 'epoch', 'seed'])
    """
    records: list[dict[str, Any]] = []

    def keep(trainer: Trainer, record: dict[str, Any]) -> None:
        record = dict(record)
        record["score"] = np.where(record["diverged"], np.nan, cell.task.score(record["return_mean"]))
        records.append(record)

    train(cell.config, make_envs=lambda number: DialEnv(cell.task, number), callback=keep)
    rows = len(records) * len(cell.seeds)
    columns = {
        "cell": pa.array([cell.id] * rows, pa.string()),
        "epoch": pa.array(np.repeat(np.arange(len(records)), len(cell.seeds)), pa.int32()),
        "seed": pa.array(np.tile(cell.seeds, len(records)), pa.int32()),
    }
    measured = {name: np.concatenate([record[name] for record in records]) for name in MEASURED}
    return pa.table(columns | {name: pa.array(x, pa.float32()) for name, x in measured.items()})


def run_cells(
    cells: Sequence[DialCell], folder: DialFolder, report: Callable[[str], None] = lambda line: None
) -> bool:
    """Run what is not finished, in order; a run that was interrupted goes on with the next cell.

    Args:
        cells: which.
        folder: where to.
        report: called with a line for each cell.

    Returns:
        Whether the map is whole; it is then written.

    Raises:
        BlockingIOError: another process runs in the folder.
    """
    for path in (folder.work, folder.results):  # an impossible folder is found out now
        path.mkdir(parents=True, exist_ok=True)
    with contextlib.ExitStack() as stack:
        try:
            stack.enter_context(held(folder.work))
        except BlockingIOError as error:
            raise BlockingIOError(
                f"another process runs in {folder.work}: wait until it is done, or choose another --work"
            ) from error
        for i, cell in enumerate(cells, 1):
            if folder.finished(cell):
                report(f"{i}/{len(cells)} {cell.id}: finished before")
                continue
            wall, processor = time.perf_counter(), time.process_time()
            table = run_cell(cell)
            seconds = time.process_time() - processor
            about = json.dumps({"config": plain(cell), "seconds": seconds, **provenance()})
            write_whole(folder.cell_file(cell), parquet_bytes(table, about))
            report(
                f"{i}/{len(cells)} {cell.id}: {seconds:.1f} s of processor time, "
                f"{time.perf_counter() - wall:.0f} s of the clock"
            )
        return pack(folder)


def pack(folder: DialFolder) -> bool:
    """Write the map and its checksum, if all its cells are finished; return whether they are."""
    cells = dial_cells()
    if not all(folder.finished(cell) for cell in cells):
        return False
    tables = [read_table(folder.cell_file(cell)).replace_schema_metadata(None) for cell in cells]
    said = [folder.about(cell) for cell in cells]
    of_the_map = {
        "configs": {cell.id: each["config"] for cell, each in zip(cells, said, strict=True)},
        "seconds": {cell.id: each["seconds"] for cell, each in zip(cells, said, strict=True)},
        "ran_on": [
            json.loads(text) for text in sorted({json.dumps({k: each[k] for k in RAN_ON}) for each in said})
        ],
    }
    data = parquet_bytes(pa.concat_tables(tables), json.dumps(of_the_map))
    folder.results.mkdir(parents=True, exist_ok=True)
    digest = hashlib.sha256(data).hexdigest()
    write_whole(folder.sum_file, f"{digest}  {folder.map_file.name}\n".encode())
    write_whole(folder.map_file, data)
    return True


def wrong_cells(folder: DialFolder, *, cells: Sequence[DialCell], epochs: int = 2) -> list[str]:
    """Run the first epochs of some cells again and return the ids of those whose scores differ from the map's.

    Args:
        folder: of the map.
        cells: which.
        epochs: how many.
    """
    stored = folder.read()
    configs = about_of(stored.schema)["configs"]
    wrong = []
    for cell in cells:
        rows = np.array(stored["cell"].to_numpy() == cell.id)
        score = stored["score"].to_numpy()[rows][: epochs * len(cell.seeds)]
        again = run_cell(DialCell(cell.policy, cell.fraction, cell.cost, cell.dims, epochs=epochs))
        same = np.allclose(score, again["score"].to_numpy(), atol=1e-3, equal_nan=True)
        if not same or not is_of(cell, configs[cell.id]):
            wrong.append(cell.id)
    return wrong
