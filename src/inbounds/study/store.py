"""What the study leaves: a Parquet file per cell, policies, checksums.

    results/cells/ID.parquet          one row per epoch and seed; `COLUMNS` is the schema
    results/policies/ID.safetensors   the final policies of all seeds (`inbounds.learning.load_policies`)
    results/policies/ID.parquet       their returns: one row per seed, way to act and episode
    results/checksums.txt             SHA-256 of each file, as `sha256sum --check` reads it

A cell is finished when its Parquet file is there; that is written last, whole, and after its checksum.
"""

from __future__ import annotations

import hashlib
import json
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pyarrow as pa

from inbounds.learning import TrainConfig, TrainedPolicy, load_policies
from inbounds.learning.storage.parquet import read_about, read_table
from inbounds.learning.storage.run_metadata import metadata_of
from inbounds.learning.storage.run_store import COLUMNS as OF_A_RUN
from inbounds.learning.storage.stored_config import changed_fields
from inbounds.learning.storage.whole_files import DamagedFileError, file_lock, remove_leftovers, write_whole
from inbounds.study.cell import Cell, digest_of

ROOT = Path(__file__).resolve().parents[3]  # src/inbounds/study/store.py
CHECKSUMS_FILE = "checksums.txt"
OF_MANY_CELLS = ("nothing", "records")
"""Files of `evaluations` that are of no one cell."""
MOTIONS = "motions.safetensors"
UNTRAINED = "untrained.json"
GREENHOUSE = "greenhouse"  # a folder
MAKERS: Mapping[str, str] = {
    MOTIONS: "play the robots (python -m inbounds.book.motions)",
    UNTRAINED: "play the untrained policies (python -c "
    "'from inbounds.study.ledger.untrained_returns import main; main()')",
    GREENHOUSE: "train the greenhouses (python -m inbounds.book.own_task.greenhouse_runs)",
}
"""How files and folders are made that are of no cell."""
State = Literal["missing", "finished", "damaged", "another configuration"]

EVERY_EPOCH: Mapping[str, tuple[pa.DataType, str]] = {
    "epoch": OF_A_RUN["epoch"],
    "seed": (pa.int32(), "the seed"),
    "env_steps": OF_A_RUN["env_steps"],
    "seconds": (pa.float64(), "wall time of the epoch, all seeds together, without evaluation [s]"),
    "episodes": (pa.int32(), "episodes that ended within the epoch; 0 once the seed has diverged"),
    "return_mean": (
        pa.float64(),
        "mean undiscounted return of those episodes; NaN where none ended or the seed had diverged before",
    ),
    "diverged": (pa.bool_(), "the seed's weights are not finite"),
}
_DIAGNOSTICS = (
    "entropy",
    "kl",
    "approx_kl",
    "clip_fraction",
    "accepted",
    "step_fraction",
    "explained_variance",
    "action_std",
    "saturation",
)
_NOISE = "of the policy that drew the epoch's rollout, over its states and the action's dimensions"
MEASURED: Mapping[str, tuple[pa.DataType, str]] = {
    "greedy_return": (
        pa.float64(),
        "undiscounted return of one episode without noise, acting by the median",
    ),
    "evaluation_seconds": (pa.float64(), "wall time of that evaluation, all seeds together [s]"),
    **{name: (pa.float32(), OF_A_RUN[name][1]) for name in _DIAGNOSTICS},
    **{f"abs_loc_q{q:02}": (pa.float32(), f"{q} % quantile of |μ|, {_NOISE}") for q in (50, 90, 99)},
    **{f"scale_q{q:02}": (pa.float32(), f"{q} % quantile of σ, {_NOISE}") for q in (1, 50, 99)},
    "at_log_std_min": (pa.float32(), f"fraction of log σ at the lower clip, {_NOISE}"),
    "at_log_std_max": (pa.float32(), f"fraction of log σ at the upper clip, {_NOISE}"),
    **{f"alpha_q{q:02}": (pa.float32(), f"{q} % quantile of α, {_NOISE}") for q in (1, 50, 99)},
    **{f"beta_q{q:02}": (pa.float32(), f"{q} % quantile of β, {_NOISE}") for q in (1, 50, 99)},
    "at_alpha_max": (pa.float32(), f"fraction of α at the cap, {_NOISE}"),
    "at_beta_max": (pa.float32(), f"fraction of β at the cap, {_NOISE}"),
}
COLUMNS: Mapping[str, tuple[pa.DataType, str]] = {**EVERY_EPOCH, **MEASURED}
"""Column → type and meaning, which for what every run records is that of `run_store.COLUMNS`. Those of `MEASURED` are
null but for the first and every tenth epoch; a file has those of its algorithm and family."""

_WITHOUT_POLICY = {"episodes": 0, "return_mean": np.nan}
TIMINGS = ("seconds", "evaluation_seconds")
"""The columns that no run repeats."""


@dataclass(frozen=True)
class StudyFolder:
    """Where results go, and where unfinished work is kept.

    Args:
        results: what is shared and published.
        work: claims and checkpoints; several machines that work together must share it too.

    Example:
        >>> from inbounds.study.grid import select
        >>> cell, = select(["standard-hopper-ppo-beta"])
        >>> StudyFolder().cell_file(cell).as_posix(), StudyFolder().state(cell)  # in the project's folder
        ('results/cells/standard-hopper-ppo-beta.parquet', 'finished')
    """

    results: Path = Path("results")
    work: Path = Path("runs/study")

    def __post_init__(self) -> None:
        for name in ("results", "work"):
            object.__setattr__(self, name, Path(getattr(self, name)))

    @classmethod
    def shipped(cls, root: Path = ROOT) -> StudyFolder:
        """Return the folders of the study that the project ships, wherever Python was started.

        Args:
            root: of the source tree.

        Raises:
            FileNotFoundError: there are no results: the package was installed without its source tree.
        """
        if not (root / "results" / "PROTOCOL.md").is_file():
            raise FileNotFoundError(
                "the study is not part of the installed package: clone the project, and `pip install -e .` in it"
            )
        return cls(root / "results", root / "runs" / "study")

    def cell_file(self, cell: Cell) -> Path:
        """Return the path of a cell's rows."""
        return self.results / "cells" / f"{cell.id}.parquet"

    def policy_files(self, cell: Cell) -> tuple[Path, Path]:
        """Return the paths of a cell's policies and of their returns."""
        folder = self.results / "policies" if cell.keeps_policies else self.work_of(cell)
        return folder / f"{cell.id}.safetensors", folder / f"{cell.id}.parquet"

    def files(self, cell: Cell) -> list[Path]:
        """Return the paths of all that a cell contributes to the results."""
        return [self.cell_file(cell), *(self.policy_files(cell) if cell.keeps_policies else ())]

    def work_of(self, cell: Cell) -> Path:
        """Return the folder of a cell's claim and checkpoints."""
        return self.work / cell.id

    def state(self, cell: Cell) -> State:
        """Return the state of a cell: its files must have their checksums, and its configuration must be the cell's."""
        path = self.cell_file(cell)
        if not path.is_file():
            return "missing"
        if self.damaged_files(cell):
            return "damaged"
        return "finished" if is_of(cell, read_metadata(path)) else "another configuration"

    def damaged_files(self, cell: Cell) -> list[Path]:
        """Return which files of a finished cell are not there, or are not those of their checksums or of the study."""
        sums = self.checksums()
        wrong = [f for f in self.files(cell) if not f.is_file() or sums.get(self._name(f)) != sha256(f)]
        try:
            if not wrong:
                read_metadata(self.cell_file(cell))
        except DamagedFileError:
            return [self.cell_file(cell)]
        return wrong

    def load_policies(self, cell: Cell) -> list[TrainedPolicy]:
        """Load the policies that a cell has kept.

        Raises:
            FileNotFoundError: there are none.
            DamagedFileError: their file is damaged.

        Example:
            >>> from inbounds.study.grid import select
            >>> cell, = select(["standard-hopper-ppo-beta"])
            >>> StudyFolder().load_policies(cell)[9]  # in the project's folder
            <TrainedPolicy: beta, ppo, Hopper-v5, seed 9>
        """
        path = self.policy_files(cell)[0]
        if not path.is_file():
            raise FileNotFoundError(f"there is no {path}: {make(path)}")
        return load_policies(path, restore(path))

    def checksums(self) -> dict[str, str]:
        """Return SHA-256 by file name, relative to the results; empty if there is no list."""
        try:
            # A damaged list names no file, and `damaged_files` says so.
            lines = (self.results / CHECKSUMS_FILE).read_text("utf8", "replace").splitlines()
        except FileNotFoundError:
            return {}
        return {name: digest for digest, _, name in (line.partition("  ") for line in lines) if name}

    def publish(self, contents: Mapping[Path, Any]) -> None:
        """Write files of the results, bytes or buffers by path: each whole, the last last, their checksums before."""
        self.results.mkdir(parents=True, exist_ok=True)
        new = {self._name(path): hashlib.sha256(data).hexdigest() for path, data in contents.items()}
        with file_lock(self.results / ".lock"):
            sums = self.checksums() | new
            lines = "".join(f"{sums[name]}  {name}\n" for name in sorted(sums))
            remove_leftovers(self.results / CHECKSUMS_FILE)
            write_whole(self.results / CHECKSUMS_FILE, lines.encode())
            # Below the lock: of two writers of a file the last one's sum holds.
            for path, data in contents.items():
                path.parent.mkdir(parents=True, exist_ok=True)
                remove_leftovers(path)
                write_whole(path, data)

    def _name(self, path: Path) -> str:
        return path.relative_to(self.results).as_posix()


def is_of(cell: Cell, metadata: Mapping[str, Any]) -> bool:
    """Return whether a file that says so much of itself is of a cell, in the version of its study."""
    return metadata["study_version"] == cell.version and not changed_fields(cell.config, metadata["config"])


def sha256(path: Path) -> str:
    """Return the SHA-256 of a file, in hexadecimal digits."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


# ---- tables


def table_of(
    config: TrainConfig, records: Sequence[Mapping[str, Any]], measurements: Sequence[Mapping[str, Any]]
) -> pa.Table:
    """Return the rows of a run, epoch by epoch and seed by seed.

    Args:
        config: of the run.
        records: of every epoch, as a `Trainer` keeps them.
        measurements: of the first and every tenth epoch: `epoch`, and `[S]` by the names of `MEASURED`.

    Returns:
        The table. Rows of a seed that had diverged before the epoch hold no results: what its robot did while
        nobody led it is neither a return nor a measurement of the policy.
    """
    num_seeds, rows = len(config.seeds), len(records) * len(config.seeds)
    leaderless = np.zeros(rows, np.bool_)
    leaderless[num_seeds:] = np.concatenate([record["diverged"] for record in records])[:-num_seeds]
    fields, arrays = [], []
    for name, (kind, meaning) in EVERY_EPOCH.items():
        values = [config.seeds if name == "seed" else record[name] for record in records]
        column = np.concatenate([np.broadcast_to(value, num_seeds) for value in values])
        if name in _WITHOUT_POLICY:
            column = np.where(leaderless, _WITHOUT_POLICY[name], column)
        arrays.append(pa.array(column, kind, from_pandas=False))
        fields.append(pa.field(name, kind, nullable=False, metadata={"meaning": meaning}))
    at = np.array([m["epoch"] * num_seeds + s for m in measurements for s in range(num_seeds)], np.int64)
    for name in [name for name in MEASURED if measurements and name in measurements[0]]:
        kind, meaning = MEASURED[name]
        column, absent = np.full(rows, np.nan), np.ones(rows, np.bool_)
        column[at] = np.concatenate([np.broadcast_to(m[name], num_seeds) for m in measurements])
        absent[at] = False
        if name not in TIMINGS:
            column[leaderless] = np.nan
        arrays.append(pa.array(column.astype(kind.to_pandas_dtype()), kind, mask=absent, from_pandas=False))
        fields.append(pa.field(name, kind, metadata={"meaning": meaning}))
    return pa.Table.from_arrays(arrays, schema=pa.schema(fields))


def cell_metadata(cell: Cell, config: TrainConfig, **more: Any) -> str:
    """Return what a cell's file says of itself, as JSON: its configuration, its name, versions, and more."""
    cell_fields = ("arm", "algorithm", "family", "robot", "variant", "preset")
    about = {"study_version": cell.version, "id": cell.id, "digest": digest_of(config, cell.version)}
    about |= {name: getattr(cell, name) for name in cell_fields}
    return json.dumps(json.loads(metadata_of(config)) | about | more)


def read_cell(path: str | Path) -> pa.Table:
    """Read the rows of a cell; `read_metadata` gives what belongs to them.

    Args:
        path: of results/cells/ID.parquet.

    Returns:
        The table, with the columns of `COLUMNS` of its algorithm and family.

    Raises:
        FileNotFoundError: there is no such file.
        DamagedFileError: it is damaged.

    Example:
        >>> read_cell("results/cells/standard-hopper-ppo-beta.parquet").num_rows  # 500 epochs of ten seeds
        5000
    """
    try:
        return read_table(path, restore(path))
    except FileNotFoundError as error:
        raise FileNotFoundError(f"there is no {path}: {make(path)}") from error


def read_metadata(path: str | Path, *keys: str) -> dict[str, Any]:
    """Return what a cell's file says of itself.

    Args:
        path: of the file.
        *keys: entries that it must have beside configuration, version and name.

    Raises:
        FileNotFoundError: there is no such file.
        DamagedFileError: it is damaged, or lacks a key.
    """
    return read_about(path, restore(path), ("config", "study_version", "id", *keys))


def restore(path: str | Path) -> str:
    """Return what to do about a damaged result, which depends on what makes the files of its folder.

    Example:
        >>> restore("results/evaluations/standard-ant-ppo-beta.parquet").partition("delete it and ")[2]
        'play the policies (inbounds study evaluate standard-ant-ppo-beta)'
        >>> restore("results/policies/standard-ant-ppo-beta.safetensors").partition("or ")[2]
        'delete results/cells/standard-ant-ppo-beta.parquet and run the cell (inbounds study run standard-ant-ppo-beta)'
    """
    path = Path(path)
    what = "it"
    if path.parent.name == "policies":  # the cell counts as run while its rows are there
        what = str(path.parent.parent / "cells" / f"{path.stem}.parquet")
    return f"restore it (git checkout -- {shlex.quote(str(path))}), or delete {what} and {make(path)}"


def make(path: str | Path) -> str:
    """Return how a result is made, which depends on its folder.

    Example:
        >>> make("results/motions.safetensors")
        'play the robots (python -m inbounds.book.motions)'
        >>> make("results/greenhouse/beta.safetensors")
        'train the greenhouses (python -m inbounds.book.own_task.greenhouse_runs)'
    """
    path = Path(path)
    if maker := MAKERS.get(path.name) or MAKERS.get(path.parent.name):
        return maker
    if path.parent.name != "evaluations":
        return f"run the cell (inbounds study run {path.stem})"
    one = "" if path.stem in OF_MANY_CELLS else f" {path.stem}"
    return f"play the policies (inbounds study evaluate{one})"
