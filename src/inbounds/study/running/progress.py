"""How a study goes: bars on a terminal, plain lines elsewhere, and a table for `inbounds study status`."""

from __future__ import annotations

import contextlib
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeRemainingColumn
from rich.table import Column, Table

from inbounds.study.grid import Cell
from inbounds.study.running.cell_lock import is_alive, read_claim
from inbounds.study.store import StudyFolder

SECONDS_BETWEEN_LINES = 60.0
SPEED_PERIOD = 1800.0  # seconds: the time left is estimated from the speed over so long


class StudyProgress:
    """Shows cells and epochs, with the time left; a context manager.

    Args:
        cells: of the run.
        folder: where their claims are, which say how far they are.
        console: where to write; by default standard output.

    Shown by `run_study`, which has an example.
    """

    def __init__(self, cells: Sequence[Cell], folder: StudyFolder, console: Console | None = None) -> None:
        self.folder = folder
        self.console = console or Console(highlight=False, force_jupyter=False)
        self._epochs = {cell.id: 0 for cell in cells}
        self._ended = 0
        self._last_line = time.monotonic()
        self._tasks: dict[str, TaskID] = {}
        self.unsaid: BaseException | None = None
        """Why something could not be said: a reader that has gone, a full disk. The cells save before it is raised."""
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("epochs"),
            TimeRemainingColumn(elapsed_when_finished=True),
            console=self.console,
            speed_estimate_period=SPEED_PERIOD,
            disable=not self.console.is_terminal,
        )
        self._all = self._progress.add_task(self._title(), total=sum(cell.epochs for cell in cells))

    def __enter__(self) -> Self:
        self._progress.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with self._noting():
            self._progress.stop()

    def update(self, running: Sequence[Cell]) -> None:
        """Look how far the running cells are."""
        with self._noting():
            for cell in running:
                claim = read_claim(self.folder.work_of(cell)) or {}
                epoch = int(claim.get("epoch", self._epochs[cell.id]))
                if cell.id not in self._tasks:
                    self._tasks[cell.id] = self._progress.add_task(
                        f"  {cell.id}", total=cell.epochs, completed=epoch
                    )
                self._progress.update(self._tasks[cell.id], completed=epoch)
                self._epochs[cell.id] = epoch
        self._progress.update(self._all, completed=sum(self._epochs.values()))
        if not self.console.is_terminal and time.monotonic() - self._last_line > SECONDS_BETWEEN_LINES:
            self._last_line = time.monotonic()
            self.say("  ".join(f"{cell.id} {self._epochs[cell.id]}/{cell.epochs}" for cell in running))

    def done(self, cell: Cell, outcome: str, message: str = "") -> None:
        """Say what became of a cell; nothing of cells that were finished before."""
        if (task := self._tasks.pop(cell.id, None)) is not None:
            self._progress.remove_task(task)
        if "finished" in outcome:
            self._epochs[cell.id] = cell.epochs
        self._ended += 1
        self._progress.update(self._all, description=self._title(), completed=sum(self._epochs.values()))
        if outcome != "was finished":
            self.say(f"{cell.id}: {outcome}" + (f": {message}" if message else ""))

    def say(self, text: str) -> None:
        """Write a line, above the bars."""
        with self._noting():
            self.console.print(text, markup=False, soft_wrap=True)

    @contextlib.contextmanager
    def _noting(self) -> Iterator[None]:
        """Note what goes wrong, of which no cell may die; Rich makes a SystemExit of a reader that has gone."""
        try:
            yield
        except (OSError, SystemExit) as error:
            self.unsaid = self.unsaid or error

    def _title(self) -> str:
        return f"{self._ended}/{len(self._epochs)} cells"


def status_table(cells: Sequence[Cell], folder: StudyFolder) -> Table:
    """Return a table of cells by their state, one row for each arm and robot."""
    names = (Column(name, no_wrap=True) for name in ("arm", "robot"))  # whole, also in a pipe
    table = Table(*names, "finished", "running", "begun", "missing", "damaged or other")
    groups: dict[tuple[str, str], Counter[str]] = {}
    for cell in cells:
        groups.setdefault((cell.arm, cell.robot), Counter())[cell_status(cell, folder)] += 1
    for (arm, robot), count in groups.items():
        known = ("finished", "running", "begun", "missing")
        other = count.total() - sum(count[name] for name in known)
        table.add_row(arm, robot, *(str(count[name] or "") for name in known), str(other or ""))
    return table


def cell_status(cell: Cell, folder: StudyFolder) -> str:
    """Return the state of a cell's results; for one without any, whether it is running, begun or missing."""
    state = folder.state(cell)
    if state != "missing":
        return state
    work = folder.work_of(cell)
    claim = read_claim(work)
    if claim is not None and is_alive(claim):
        return "running"
    return "begun" if any(work.glob("**/checkpoint.pt")) else "missing"
