"""Many cells: on the cores of this machine, one single-threaded process per cell, or on a Dask cluster.

There is no scheduler to lose. Each process claims its cell (`cell_lock`), so several runs on one folder share the
work; whatever dies is gone on with, from its last checkpoint, by whoever comes next.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import multiprocessing.connection
import os
import signal
import subprocess
import time
import warnings
from collections import deque
from collections.abc import Iterator, Sequence
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from types import FrameType
from typing import NamedTuple

from inbounds.study.grid import Cell
from inbounds.study.running.attempts import (
    OTHER_FOLDERS,
    RETRIES,
    SIGNALS,
    CellReport,
    Settings,
    Summary,
    attempt,
    handling,
)
from inbounds.study.running.cluster import run_on_cluster
from inbounds.study.running.progress import StudyProgress
from inbounds.study.store import StudyFolder

ENVIRONMENT = {  # of the processes; none of it changes a result
    "OMP_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    # glibc raises its threshold for giving memory back as larger blocks are freed; held, HalfCheetah needs half as much
    "MALLOC_MMAP_THRESHOLD_": str(1 << 20),
}
LOOK_EVERY = 1.0  # seconds between looks at running cells
MOST_WARNINGS = 20  # of a cell that are shown


def run_study(
    cells: Sequence[Cell],
    folder: StudyFolder,
    settings: Settings | None = None,
    progress: StudyProgress | None = None,
) -> Summary:
    """Run cells in their order, finished ones not again. Running it again goes on where it stopped.

    The first Ctrl-C (or SIGTERM, or a closed terminal) has running cells end their epoch, save and stop; so does output
    that nobody reads any more (`| head`). The second kills them.

    Args:
        cells: which.
        folder: where results and work are.
        settings: how; None is one process per core of this machine.
        progress: shows what goes on; None shows plain lines.

    Returns:
        What became of each cell.

    Example:
        >>> from inbounds.study import StudyFolder, select
        >>> summary = run_study(select(["standard-hopper-ppo-beta"]), StudyFolder())  # in the project's folder
        >>> summary.reports["standard-hopper-ppo-beta"].outcome
        'was finished'
    """
    settings = settings or Settings()
    with progress or StudyProgress(cells, folder) as shown:
        if settings.scheduler is not None:
            summary = run_on_cluster(cells, folder, settings, shown)
        else:
            summary = _LocalRun(cells, folder, settings, shown).run()
    if shown.unsaid is not None and not summary.signal:
        raise shown.unsaid
    return summary


class _Running(NamedTuple):
    cell: Cell
    process: SpawnProcess
    results: Connection


class _LocalRun:
    """The parent of the processes."""

    def __init__(
        self, cells: Sequence[Cell], folder: StudyFolder, settings: Settings, progress: StudyProgress
    ) -> None:
        self.folder, self.settings, self.progress = folder, settings, progress
        self.waiting = deque(cells)
        self.running: list[_Running] = []
        self.reports: dict[str, CellReport] = {}
        self.deaths: dict[str, int] = {}
        self.jobs = settings.jobs or cores()
        minutes = settings.max_minutes
        self.deadline = float("inf") if minutes is None else time.time() + 60 * minutes
        self.signal = 0

    def run(self) -> Summary:
        """Start, watch and end processes until nothing is left to do."""
        unheard = False  # nobody reads the output, or it cannot be written
        with self._listening():
            try:
                while self.waiting or self.running:
                    if self.progress.unsaid is not None and not self.signal and not unheard:
                        unheard = True
                        self._stop_cells()
                    if self.signal or unheard or time.time() > self.deadline:
                        self.waiting.clear()
                    while self.waiting and len(self.running) < self.jobs and not self.signal:
                        self._start(self.waiting.popleft())
                    # A report that is larger than the pipe holds its process until it is read.
                    ends = [end for r in self.running for end in (r.results, r.process.sentinel)]
                    ready = multiprocessing.connection.wait(ends, timeout=LOOK_EVERY)
                    for running in [r for r in self.running if {r.results, r.process.sentinel} & {*ready}]:
                        self._end(running)
                    self.progress.update([r.cell for r in self.running])
            finally:
                for running in self.running:  # only after an error here, or a second Ctrl-C
                    running.process.kill()
                    running.process.join()
        return Summary(self.reports, self.signal)

    def _start(self, cell: Cell) -> None:
        try:
            if self.folder.state(cell) == "finished":
                return self._report(cell, CellReport("was finished"))
        except OSError as error:
            return self._report(cell, CellReport("failed", f"{error}: {OTHER_FOLDERS}"))
        context = multiprocessing.get_context("spawn")  # a fork would inherit torch's threads
        receiver, sender = context.Pipe(duplex=False)
        arguments = (cell, self.folder, self.settings.nice, self.deadline, os.getpid(), sender)
        process = context.Process(target=_run_in_child, args=arguments, name=cell.id)
        with _lean(), _signals_held():
            if not self.signal:  # one that came just now found nothing of this cell to stop
                process.start()
                self.running.append(_Running(cell, process, receiver))
        sender.close()
        return None

    def _end(self, running: _Running) -> None:
        cell, process, results = running
        self.running.remove(running)
        try:
            report, warned = results.recv()
        except (EOFError, OSError):  # it died before its report, or in the middle of it
            process.join()
            report, warned = self._death(cell, process.exitcode or 0), []
        process.join()
        results.close()
        for message in warned:
            self.progress.say(f"{cell.id}: {message}")
        if report is not None:
            self._report(cell, report)

    def _death(self, cell: Cell, code: int) -> CellReport | None:
        """Have the cell gone on with, a few times; then let somebody look."""
        if self.signal:
            return CellReport("stopped")
        how = signal.Signals(-code).name if code < 0 else f"exit code {code}"
        self.deaths[cell.id] = self.deaths.get(cell.id, 0) + 1
        if self.deaths[cell.id] <= RETRIES:
            self.progress.say(f"{cell.id}: its process died ({how}); going on from its last checkpoint")
            self.waiting.appendleft(cell)
            return None
        return CellReport(
            "died", f"its process died ({how}), as when memory runs out: run again, perhaps with fewer --jobs"
        )

    def _report(self, cell: Cell, report: CellReport) -> None:
        self.reports[cell.id] = report
        self.progress.done(cell, report.outcome, report.message)
        if report.outcome == "disk full":  # for the next cell too
            self.waiting.clear()
        # One that was finished may have lost its commit: the process was killed before it, or git refused.
        wanted = report.outcome in ("finished", "was finished") and self.settings.commit
        if wanted and (complaint := commit_cell(cell, self.folder)):
            self.progress.say(complaint)

    @contextlib.contextmanager
    def _listening(self) -> Iterator[None]:
        """Take signals to stop, and hand them on to the processes."""

        def take(number: int, frame: FrameType | None) -> None:
            if self.signal:
                raise KeyboardInterrupt
            self.signal = number
            self._stop_cells()
            self.progress.say("stopping after the epochs under way; again to stop at once")

        with handling(take):
            yield

    def _stop_cells(self) -> None:
        """Have the running cells end their epoch, save and stop."""
        for running in self.running:
            running.process.terminate()


def _run_in_child(
    cell: Cell, folder: StudyFolder, nice: int, deadline: float, parent: int, results: Connection
) -> None:
    """Run the cell in a process of its own, and send what became of it and the warnings on the way."""
    asked_to_stop: list[int] = []
    with handling(lambda number, frame: asked_to_stop.append(number)):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
        os.nice(nice)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            # A killed parent stops the cell, too: whoever comes next should find the cores free.
            report = attempt(cell, folder, lambda: bool(asked_to_stop) or os.getppid() != parent, deadline)
        # A parent that is gone reads nothing.
        with contextlib.suppress(BrokenPipeError):
            results.send((report, _each_once([str(warning.message) for warning in caught])))


def _each_once(messages: Sequence[str]) -> list[str]:
    """Different messages, the first ones; how many more there were is said."""
    different = list(dict.fromkeys(messages))
    more = len(different) - MOST_WARNINGS
    return [*different[:MOST_WARNINGS], *([f"and {more} more warnings"] if more > 0 else [])]


def commit_cell(cell: Cell, folder: StudyFolder) -> str:
    """Commit the files of a finished cell, and nothing else; nothing where git has them.

    Returns:
        What went wrong; empty if nothing did.
    """
    paths = [str(path.resolve()) for path in (*folder.files(cell), folder.results / "checksums.txt")]
    git = ["git", "-C", str(folder.results)]
    try:
        status = [*git, "status", "--porcelain", "--", *paths[:-1]]
        if not subprocess.run(status, capture_output=True, text=True, check=True).stdout:
            return ""
        for command in (["add", "--", *paths], ["commit", "-m", f"Add study cell {cell.id}", "--", *paths]):
            subprocess.run([*git, *command], capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError) as error:
        said = getattr(error, "stderr", "") or error
        return f"{cell.id} is finished, but git did not commit it ({said}): commit it by hand"
    return ""


def cores() -> int:
    """Return how many cores this process may use.

    Example:
        >>> cores() >= 1
        True
    """
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextlib.contextmanager
def _signals_held() -> Iterator[None]:
    """Have signals wait, in processes that start now until they can handle them."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextlib.contextmanager
def _lean() -> Iterator[None]:
    """Have processes that start now use one thread, also before torch is told so, and give memory back."""
    before = {name: os.environ.get(name) for name in ENVIRONMENT}
    os.environ.update(ENVIRONMENT)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
