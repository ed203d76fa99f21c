"""One cell, from its last checkpoint to its file in the results, in this process.

The loop is the one of `inbounds.learning.train`, plus measurements after some epochs, which must be in the same
checkpoint as the epoch that they belong to.
"""

from __future__ import annotations

import contextlib
import os
import shlex
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

import pyarrow as pa
import safetensors

from inbounds.learning.storage import checkpoint
from inbounds.learning.storage.parquet import parquet_bytes
from inbounds.learning.storage.run_store import load_checkpoint, save_policies
from inbounds.learning.storage.whole_files import DamagedFileError, is_disk_full, remove_leftovers
from inbounds.study import store
from inbounds.study.grid import Cell
from inbounds.study.running.cell_lock import CellLock
from inbounds.study.running.evaluate import GREEDY, evaluate_finally
from inbounds.study.running.measure import MeasuredTrainer
from inbounds.study.running.provenance import provenance
from inbounds.study.store import StudyFolder

PREVIOUS = "previous"  # folder of the checkpoint before the last
Ending = Literal["finished", "stopped", "was finished"]


class StudyError(RuntimeError):
    """A cell cannot go on; the message says what to do."""


class DiskFullError(StudyError):
    """There is no room: no other cell could go on either."""


def run_cell(
    cell: Cell,
    folder: StudyFolder,
    *,
    stop: Callable[[], bool] = lambda: False,
    deadline: float = float("inf"),
) -> Ending:
    """Run a cell, going on from its last checkpoint, until it is finished or shall stop.

    Args:
        cell: which.
        folder: where results and work are.
        stop: asked after every epoch; True saves a checkpoint and returns.
        deadline: `time.time()` that no epoch shall end after, by the last one's length.

    Returns:
        "finished", "stopped", or "was finished" already.

    Raises:
        ClaimedError: another process runs the cell.
        DiskFullError: there is no room for a checkpoint or the results.
        StudyError: what is there is damaged or belongs to another configuration.

    Example:
        >>> import tempfile
        >>> from pathlib import Path
        >>> from inbounds.study import Cell, StudyFolder, read_cell
        >>> small = (("horizon", 64), ("minibatch_size", 32), ("num_epochs", 1))
        >>> cell = Cell("test", "ppo", "beta", "Swimmer", seeds=(0, 1), epochs=10, overrides=small)
        >>> with tempfile.TemporaryDirectory() as name:
        ...     folder = StudyFolder(Path(name, "results"), Path(name, "work"))
        ...     run_cell(cell, folder), run_cell(cell, folder), read_cell(folder.cell_file(cell)).num_rows
        ('finished', 'was finished', 20)
    """
    if _is_finished(cell, folder):
        return "was finished"
    folder.cell_file(cell).parent.mkdir(parents=True, exist_ok=True)  # an impossible folder is found out now
    try:
        with CellLock.take(folder.work_of(cell)) as claim:
            if _is_finished(cell, folder):  # by whoever had the claim a moment ago
                return "was finished"
            return _CellRun(cell, folder, claim).run(stop, deadline)
    except (OSError, RuntimeError, safetensors.SafetensorError, pa.ArrowException) as error:
        if is_disk_full(error):
            work = shlex.quote(str(folder.work))
            raise DiskFullError(
                f"{cell.id}: the disk is full. The last checkpoint is kept; make room (df -h {work}) "
                "and run the study again"
            ) from error
        raise


def _is_finished(cell: Cell, folder: StudyFolder) -> bool:
    """Return whether nothing is left to do, and raise where something is in the way."""
    state, path = folder.state(cell), folder.cell_file(cell)
    if state == "damaged":
        first = folder.damaged_files(cell)[0]
        raise StudyError(
            f"{first}, or its line in {store.CHECKSUMS_FILE}, is damaged: {store.restore(first)}"
        )
    if state == "another configuration":
        raise StudyError(
            f"{path} is the result of another configuration or study version than {cell.version}: "
            "use another --results folder, or move it away; one study never mixes two"
        )
    return state == "finished"


class _CellRun:
    """A claimed cell."""

    def __init__(self, cell: Cell, folder: StudyFolder, claim: CellLock) -> None:
        self.cell, self.folder, self.claim = cell, folder, claim
        self.work = folder.work_of(cell)
        for name in (checkpoint.FILE_NAME, folder.policy_files(cell)[0].name):
            remove_leftovers(self.work / name)  # of a part that was killed while it wrote
        self.run_ = MeasuredTrainer(cell)
        with contextlib.ExitStack() as undone:
            undone.callback(self.run_.close)
            self._restore()
            self.kept = self.run_.done
            self._begin_session()
            undone.pop_all()
        self._clock = time.perf_counter()

    def _begin_session(self) -> None:
        """Note what this part of the run is made with."""
        sessions, now = self.run_.progress.sessions, provenance()
        if sessions and sessions[-1]["engine"] != now["engine"]:
            warnings.warn(
                "the engine's source has changed since the last checkpoint: if it gives other results, the cell is a "
                f"mixture; delete {self.work} to start it anew",
                stacklevel=2,
            )
        sessions.append(now | {"from_epoch": self.kept})

    def run(self, stop: Callable[[], bool], deadline: float) -> Ending:
        """Go on until the end, or until asked to stop."""
        run, epochs = self.run_, self.cell.epochs
        try:
            self.claim.renew(epoch=run.done, epochs=epochs)
            while run.done < epochs:
                start = time.time()
                run.epoch()
                self.claim.renew(epoch=run.done, epochs=epochs)
                if run.done % run.config.checkpoint_every == 0 or run.done == epochs:
                    self._save()
                late = time.time() + (time.time() - start) > deadline
                if run.done < epochs and (late or stop()):
                    self._save()
                    return "stopped"
            self._finish()
            return "finished"
        finally:
            run.close()

    def _save(self) -> None:
        """Write a checkpoint, keeping the one before in case this one comes to harm later."""
        if self.kept == self.run_.done:
            return
        self._tick()
        path = self.work / checkpoint.FILE_NAME
        (self.work / PREVIOUS).mkdir(exist_ok=True)
        with contextlib.suppress(FileNotFoundError):
            os.replace(path, self.work / PREVIOUS / checkpoint.FILE_NAME)
        checkpoint.save(path, self.run_.state_dict())
        self.kept = self.run_.done

    def _restore(self) -> None:
        """Go back to the last checkpoint that is whole; start anew where there never was one."""
        complaints = []
        for folder in (self.work, self.work / PREVIOUS):
            try:
                state = load_checkpoint(folder)
            except FileNotFoundError:
                continue
            except DamagedFileError as error:
                complaints.append(str(error).partition(": ")[0])
                continue
            try:
                self.run_.load_state_dict(state)
            except (ValueError, KeyError) as error:
                raise StudyError(
                    f"{folder} is not this cell's, or another version's ({error}): move {self.work} away to start anew"
                ) from error
            if complaints:
                # Out of the way: the next save puts the newest checkpoint in the place of the one that has just served.
                os.replace(self.work / checkpoint.FILE_NAME, self.work / f"damaged-{checkpoint.FILE_NAME}")
                warnings.warn(
                    f"{complaints[0]}; going on from the one before, epoch {self.run_.done}", stacklevel=2
                )
            return
        if complaints:
            raise StudyError(
                f"{' and '.join(complaints)}: put a copy in its place, or delete {self.work} to start the cell anew"
            )

    def _tick(self) -> None:
        now = time.perf_counter()
        self.run_.progress.seconds["total"] += now - self._clock
        self._clock = now

    def _finish(self) -> None:
        """Publish rows and policies, then drop what they were made from."""
        run, cell, folder = self.run_, self.cell, self.folder
        contents: dict[Path, Any] = {}
        policies, returns = folder.policy_files(cell)
        temporary = self.work / policies.name
        save_policies(temporary, run.trainer, cell.keeps_seeds)
        if cell.keeps_policies:
            start = time.perf_counter()
            rows = evaluate_finally(run.trainer)
            run.progress.seconds["final evaluation"] = time.perf_counter() - start
            contents[policies] = temporary.read_bytes()
            contents[returns] = parquet_bytes(
                pa.Table.from_pylist(rows, RETURNS), store.cell_metadata(cell, run.config)
            )
        self._tick()
        progress = run.progress
        metadata = store.cell_metadata(
            cell,
            run.config,
            greedy=GREEDY,
            sessions=progress.sessions,
            seconds=progress.seconds,
            first_rewards=progress.first_rewards.tolist(),
        )
        contents[folder.cell_file(cell)] = parquet_bytes(run.table(), metadata)
        self.claim.check()
        folder.publish(contents)
        for path in (self.work / checkpoint.FILE_NAME, self.work / PREVIOUS / checkpoint.FILE_NAME):
            path.unlink(missing_ok=True)
        if cell.keeps_policies:
            temporary.unlink()


RETURNS = pa.schema(
    [
        pa.field("seed", pa.int32(), nullable=False),
        pa.field("greedy", pa.string(), nullable=False),
        pa.field("episode", pa.int32(), nullable=False),
        pa.field("return", pa.float64(), nullable=False),
        pa.field("length", pa.int32(), nullable=False),
    ]
)
