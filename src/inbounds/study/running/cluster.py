"""The same cells on a Dask cluster, whose workers share the folders of results and work.

Start a scheduler and single-threaded workers, then name the scheduler:

    dask scheduler
    dask worker tcp://host:8786 --nworkers 8 --nthreads 1
    inbounds study run --scheduler tcp://host:8786

Under SLURM, dask-jobqueue starts both; its `scheduler_address` is what to name:

    SLURMCluster(cores=1, processes=1, memory="2GB", walltime="04:00:00").scale(40)

A worker that is lost, its time over or its machine gone, costs the epochs since
the last checkpoint: the scheduler gives the cell to another one.
"""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable, Sequence
from types import FrameType
from typing import Any

from inbounds.study.grid import Cell
from inbounds.study.running.attempts import RETRIES, CellReport, Settings, Summary, attempt, handling
from inbounds.study.running.one_cell import StudyError
from inbounds.study.running.progress import StudyProgress
from inbounds.study.store import StudyFolder

PAUSE = 5.0  # seconds until a cell is tried again that is still claimed, perhaps by a worker that is dead


def run_on_cluster(
    cells: Sequence[Cell], folder: StudyFolder, settings: Settings, progress: StudyProgress
) -> Summary:
    """Run cells on the workers of a Dask scheduler; parameters and result are those of `run_study`.

    Raises:
        StudyError: distributed is not installed, or the scheduler does not answer.
    """
    shared = StudyFolder(folder.results.resolve(), folder.work.resolve())
    minutes = settings.max_minutes
    deadline = float("inf") if minutes is None else time.time() + 60 * minutes
    stop_file = shared.work / f"stop-{os.getpid()}-{time.time_ns()}"
    signals: list[int] = []

    def stop() -> None:
        shared.work.mkdir(parents=True, exist_ok=True)
        stop_file.touch()

    def take(number: int, frame: FrameType | None) -> None:
        if signals:
            raise KeyboardInterrupt
        signals.append(number)
        stop()
        progress.say("stopping after the epochs under way; again to leave the cluster to itself")

    with _client(settings.scheduler or "") as client, handling(take):
        try:
            how = settings.nice, deadline, str(stop_file)
            reports = _run(client, cells, shared, how, progress, signals, stop)
        finally:
            if not signals:
                stop_file.unlink(missing_ok=True)
    with contextlib.suppress(FileNotFoundError):
        stop_file.unlink()
    return Summary(reports, signals[0] if signals else 0)


def _run(
    client: Any,
    cells: Sequence[Cell],
    folder: StudyFolder,
    how: tuple[Any, ...],
    progress: StudyProgress,
    signals: list[int],
    stop: Callable[[], None],
) -> dict[str, CellReport]:
    """Submit every cell, and again while somebody who may be dead claims it."""
    from distributed import TimeoutError as NothingYet
    from distributed import wait

    def submit(cell: Cell, number: int) -> Any:
        # Names make tasks unique: a cell that was claimed a moment ago is another task now.
        return client.submit(
            run_on_worker, cell, folder, *how, key=f"{cell.id}-{time.time_ns()}", priority=-number, pure=False
        )

    numbers = {cell.id: number for number, cell in enumerate(cells)}
    pending = {submit(cell, numbers[cell.id]): cell for cell in cells}
    reports: dict[str, CellReport] = {}
    again: list[tuple[float, Cell]] = []
    failures: dict[str, int] = {}
    while pending or again:
        if progress.unsaid is not None:  # nobody reads the output, or it cannot be written
            with contextlib.suppress(OSError):
                stop()
        with contextlib.suppress(NothingYet):
            if pending:
                wait(list(pending), timeout=1.0, return_when="FIRST_COMPLETED")
            else:
                time.sleep(0.2)
        for future in [future for future in pending if future.done()]:
            cell = pending.pop(future)
            try:
                report = future.result()
            except Exception as error:  # the worker died too often for Dask, or was taken away
                failures[cell.id] = failures.get(cell.id, 0) + 1
                outcome = "claimed" if failures[cell.id] <= RETRIES else "died"
                report = CellReport(outcome, f"{type(error).__name__}: {error}")
            if report.outcome == "claimed" and not signals:
                again.append((time.monotonic() + PAUSE, cell))
                continue
            if report.outcome == "disk full":  # for every other cell too
                with contextlib.suppress(OSError):
                    stop()
            reports[cell.id] = report
            progress.done(cell, report.outcome, report.message)
        now = time.monotonic()
        for item in [item for item in again if item[0] <= now or signals]:
            again.remove(item)
            pending[submit(item[1], numbers[item[1].id])] = item[1]
        progress.update([cell for cell in pending.values() if (folder.work_of(cell) / "claim.json").exists()])
    return reports


def run_on_worker(cell: Cell, folder: StudyFolder, nice: int, deadline: float, stop_file: str) -> CellReport:
    """Run a cell in a worker, until a file asks it to stop."""
    if os.path.exists(stop_file) or time.time() > deadline:
        return CellReport("stopped")
    with contextlib.suppress(OSError):
        os.nice(max(0, nice - os.nice(0)))
    return attempt(cell, folder, lambda: os.path.exists(stop_file), deadline)


def _client(address: str) -> Any:
    try:
        from distributed import Client
    except ImportError as error:
        raise StudyError("--scheduler needs Dask: pip install '.[cluster]' in the source tree") from error
    try:
        return Client(address, timeout="10s")
    except (OSError, ValueError) as error:
        raise StudyError(
            f"no Dask scheduler answers at {address!r} ({error}): start one with `dask scheduler` and name its address"
        ) from error
