"""What runs on one machine and on a cluster share: their settings, an attempt at a cell, what became of it."""

from __future__ import annotations

import contextlib
import signal
import traceback
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

from inbounds.headless import BackendError
from inbounds.study.grid import Cell
from inbounds.study.running.cell_lock import ClaimedError
from inbounds.study.running.one_cell import DiskFullError, StudyError, run_cell
from inbounds.study.store import StudyFolder

# Ctrl-C, what job schedulers send, and a closed terminal.
SIGNALS = (signal.SIGINT, signal.SIGTERM, *([signal.SIGHUP] if hasattr(signal, "SIGHUP") else []))
RETRIES = 2  # of a cell whose process died
OTHER_FOLDERS = "choose other folders with --results and --work"


@dataclass(frozen=True)
class Settings:
    """How to run cells; nothing here changes a result.

    Example:
        >>> Settings(jobs=2, nice=19, max_minutes=60).scheduler is None  # two processes on this machine, for an hour
        True
    """

    jobs: int | None = None
    """Processes at a time; None is one per core that this process may use."""
    nice: int = 0
    """Added to the processes' niceness: 19 leaves the machine to everything else that this session runs.

    Linux divides the processor between sessions first; beside those, ``echo 19 > /proc/PID/autogroup`` steps back.
    """
    max_minutes: float | None = None
    """When time is up, running cells save a checkpoint and stop; no cell is started."""
    commit: bool = False
    """Commit the results of each finished cell with git, of those too that were finished and are not committed."""
    scheduler: str | None = None
    """Address of a Dask scheduler, tcp://host:port, whose workers share the folders; None runs here."""

    def __post_init__(self) -> None:
        if self.jobs is not None and self.jobs < 1:
            raise ValueError(f"jobs must be at least 1, got {self.jobs}")
        if not 0 <= self.nice <= 19:
            raise ValueError(f"nice must be between 0 and 19, got {self.nice}")
        if self.commit and self.scheduler is not None:
            raise ValueError("a cluster's cells are not committed: leave commit or scheduler out")
        if self.max_minutes is not None and not self.max_minutes >= 0:  # NaN is no number of minutes
            raise ValueError(f"max_minutes must be 0 or more, got {self.max_minutes}")


class CellReport(NamedTuple):
    """What became of a cell.

    Part of what `run_study` returns, which has an example.
    """

    outcome: str
    """finished, was finished, stopped, claimed, failed, disk full or died."""
    message: str = ""
    """What to do, where something is to be done."""


class Summary(NamedTuple):
    """What became of a run.

    Made by `run_study`, which has an example.
    """

    reports: dict[str, CellReport]
    """By the cell's id; cells that were not started are not in it."""
    signal: int = 0
    """The one that ended it, if one did."""

    @property
    def failed(self) -> dict[str, CellReport]:
        """The cells that somebody has to do something about."""
        return {name: r for name, r in self.reports.items() if r.outcome in ("failed", "disk full", "died")}


def attempt(cell: Cell, folder: StudyFolder, stop: Any, deadline: float) -> CellReport:
    """Run a cell, whatever happens, and report it."""
    try:
        return CellReport(run_cell(cell, folder, stop=stop, deadline=deadline))
    except ClaimedError as error:
        return CellReport("claimed", str(error))
    except DiskFullError as error:
        return CellReport("disk full", str(error))
    except (StudyError, BackendError) as error:
        return CellReport("failed", str(error))
    except OSError as error:
        return CellReport("failed", f"{error}: {OTHER_FOLDERS}")
    except Exception:
        return CellReport("failed", f"a fault of the program, please report it:\n{traceback.format_exc()}")


@contextlib.contextmanager
def handling(take: Any) -> Iterator[None]:
    """Handle the signals that ask to stop; does nothing outside the main thread, which gets no signals."""
    try:
        # Under nohup a closed terminal is ignored.
        heard = [n for n in SIGNALS if n.name != "SIGHUP" or signal.getsignal(n) != signal.SIG_IGN]
        before = {number: signal.signal(number, take) for number in heard}
    except ValueError:
        yield
        return
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
