"""Jobs in processes of their own: failures are told as they happen, and Ctrl-C ends what runs."""

import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Iterator
from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console

from benchmarks.side_by_side import PEER, Job, run_jobs


def jobs(folder: Path, count: int) -> list[Job]:
    return [Job("Hopper-v5", PEER, (seed,), 1, 64, False, folder) for seed in range(count)]


def wait_for(path: Path, seconds: float = 60) -> None:
    until = time.monotonic() + seconds
    while not path.exists():
        if time.monotonic() > until:
            raise TimeoutError(path)
        time.sleep(0.05)


def fail_or_wait(job: Job) -> None:
    """Fail as the first, and as the second wait until that has been told."""
    if job.seeds == (0,):
        raise ValueError("no such robot")
    wait_for(job.folder / "told")
    (job.folder / "finished").touch()


def run_on(job: Job) -> None:
    """Run for a minute, and say that it began."""
    (job.folder / f"{job.seeds[0]}").touch()
    time.sleep(60)


def die(job: Job) -> None:
    """End without a word, as a process does for which there is no memory."""
    os._exit(1)


@pytest.mark.slow
def test_a_failure_is_told_while_the_others_go_on(tmp_path: Path) -> None:
    class Told(StringIO):
        def write(self, text: str) -> int:
            if "no such robot" in text:
                (tmp_path / "told").touch()
            return super().write(text)

    with pytest.raises(RuntimeError, match="1 of 2 jobs failed"):
        run_jobs(jobs(tmp_path, 2), 2, Console(file=Told(), width=200), fail_or_wait)
    assert (tmp_path / "finished").exists()


@pytest.fixture
def heard() -> Iterator[None]:
    """Ctrl-C is heard, as it is not in what a script has started in the background."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.slow
@pytest.mark.usefixtures("heard")
def test_ctrl_c_ends_what_runs_and_starts_nothing(tmp_path: Path) -> None:
    def interrupt() -> None:
        wait_for(tmp_path / "0")
        os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=interrupt)
    thread.start()
    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        run_jobs(jobs(tmp_path, 4), 1, Console(file=StringIO()), run_on)
    thread.join()
    assert time.monotonic() - began < 45  # less than a job takes
    assert not multiprocessing.active_children()
    assert [path.name for path in tmp_path.iterdir()] == ["0"]


@pytest.mark.slow
def test_a_process_that_dies_ends_it(tmp_path: Path) -> None:
    with pytest.raises(Exception, match="terminated abruptly"):
        run_jobs(jobs(tmp_path, 3), 1, Console(file=StringIO()), die)
