import errno
import io
import math
import os
import re
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from rich.console import Console

from inbounds.cli.studying import study
from inbounds.learning.storage import checkpoint
from inbounds.study import Cell, Settings, StudyFolder, read_cell, run_cell, run_study, store
from inbounds.study.grid import select
from inbounds.study.running import attempts, cluster, many_cells
from inbounds.study.running.attempts import RETRIES, CellReport
from inbounds.study.running.cell_lock import CellLock, read_claim
from inbounds.study.running.many_cells import commit_cell
from inbounds.study.running.progress import StudyProgress, cell_status, status_table
from inbounds.study.running.verify import check_sums, first_mismatch
from inbounds.study.store import read_metadata
from tests.study.small import folder_in, small_cell

RUN = """
import signal
import sys
from pathlib import Path
from inbounds.study import Settings, run_study
from tests.study.small import folder_in, small_cell

if __name__ == "__main__":
    signal.signal(signal.SIGHUP, signal.SIG_DFL)  # the tests may run under nohup
    cells = [small_cell(family=family, epochs=EPOCHS) for family in ("gaussian", "beta", "logit-normal")]
    summary = run_study(cells, folder_in(Path(sys.argv[1])), Settings(jobs=int(sys.argv[2])))
    sys.exit(128 + summary.signal if summary.signal else bool(summary.failed))
"""


def cells_of(epochs: int) -> list[Cell]:
    return [small_cell(family=family, epochs=epochs) for family in ("gaussian", "beta", "logit-normal")]


def start(path: Path, epochs: int, jobs: int = 2) -> subprocess.Popen[str]:
    """A study in a process of its own, as a shell starts it: in its own process group."""
    script = path / "script.py"
    script.write_text(RUN.replace("EPOCHS", str(epochs)))
    root = Path(__file__).parents[3]
    return subprocess.Popen(
        [sys.executable, str(script), str(path), str(jobs)],
        cwd=root,
        env=os.environ | {"PYTHONPATH": f"{root / 'src'}{os.pathsep}{root}"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )


def run_script(script: str, folder: Path, timeout: float) -> subprocess.CompletedProcess[str]:
    """A script in a process of its own, with the folder as its argument, to its end."""
    path, root = folder / "script.py", Path(__file__).parents[3]
    path.write_text(script)
    return subprocess.run(
        [sys.executable, str(path), str(folder)],
        cwd=root,
        env=os.environ | {"PYTHONPATH": f"{root / 'src'}{os.pathsep}{root}"},
        capture_output=True,
        text=True,
        timeout=timeout,
        check=False,
    )


def wait_until(true: Callable[[], object], seconds: float = 120) -> None:
    deadline = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < deadline, "it never came true"
        time.sleep(0.02)


def alone(cell: Cell, path: Path) -> pa.Table:
    """The rows of a cell that nothing ever happened to."""
    folder = folder_in(path / "alone")
    run_cell(cell, folder)
    return read_cell(folder.cell_file(cell))


def has_checkpoint(folder: StudyFolder, cell: Cell) -> bool:
    return (folder.work_of(cell) / checkpoint.FILE_NAME).exists()


def quiet(cells: list[Cell], folder: StudyFolder) -> tuple[StudyProgress, io.StringIO]:
    said = io.StringIO()
    return StudyProgress(cells, folder, Console(file=said, width=200)), said


@pytest.mark.slow
def test_a_killed_process_costs_a_few_epochs_and_changes_nothing(tmp_path: Path) -> None:
    cell, folder = small_cell(epochs=30), folder_in(tmp_path)
    process = start(tmp_path, 30, jobs=1)
    wait_until(lambda: has_checkpoint(folder, cell))
    pid = (read_claim(folder.work_of(cell)) or {})["pid"]
    assert pid != process.pid
    os.kill(pid, signal.SIGKILL)
    wait_until(
        lambda: has_checkpoint(folder, cells_of(30)[1])
    )  # the next cell is under way: the first one is done
    os.killpg(process.pid, signal.SIGKILL)  # and now all of it, as when the machine goes down
    said, _ = process.communicate()
    assert f"{cell.id}: its process died (SIGKILL); going on from its last checkpoint" in said
    assert first_mismatch(alone(cell, tmp_path), read_cell(folder.cell_file(cell))) == ""
    sessions = read_metadata(folder.cell_file(cell))["sessions"]
    assert [session["from_epoch"] % 10 for session in sessions] == [0, 0]
    assert sessions[1]["from_epoch"] > 0
    assert run_cell(cells_of(30)[1], folder) == "finished"  # the claim of the dead falls at once


WISHES = [signal.SIGINT, *(pytest.param(n, marks=pytest.mark.slow) for n in (signal.SIGTERM, signal.SIGHUP))]


@pytest.mark.parametrize("number", WISHES)
def test_a_wish_to_stop_is_granted_after_the_epoch(tmp_path: Path, number: signal.Signals) -> None:
    folder, cell = folder_in(tmp_path), small_cell(epochs=100_000)
    process = start(tmp_path, 100_000, jobs=1)
    wait_until(lambda: (read_claim(folder.work_of(cell)) or {}).get("epoch"))
    if number != signal.SIGTERM:
        os.killpg(process.pid, number)  # as a terminal does
    else:
        process.send_signal(number)
    said, _ = process.communicate(timeout=60)
    assert process.returncode == 128 + number
    assert "stopping after the epochs under way" in said
    assert f"{cell.id}: stopped" in said
    assert "Traceback" not in said
    assert has_checkpoint(folder, cell)
    assert read_claim(folder.work_of(cell)) is None


@pytest.mark.parametrize("set_before", [signal.SIG_IGN, signal.SIG_DFL], ids=["nohup", "terminal"])
def test_a_closed_terminal_is_a_wish_to_stop_except_under_nohup(set_before: signal.Handlers) -> None:
    found = signal.signal(signal.SIGHUP, set_before)
    try:
        with attempts.handling(lambda *_: None):
            assert (signal.getsignal(signal.SIGHUP) == signal.SIG_IGN) == (set_before == signal.SIG_IGN)
        assert signal.getsignal(signal.SIGHUP) == set_before
    finally:
        signal.signal(signal.SIGHUP, found)


def test_a_wish_to_stop_that_ends_the_reader_too_is_granted(tmp_path: Path) -> None:
    folder, cell = folder_in(tmp_path), small_cell(epochs=100_000)
    process = start(tmp_path, 100_000, jobs=1)
    wait_until(lambda: (read_claim(folder.work_of(cell)) or {}).get("epoch"))
    assert process.stdout is not None
    process.stdout.close()  # `inbounds study run | tee log`, and Ctrl-C
    os.killpg(process.pid, signal.SIGINT)
    assert process.wait(60) == 128 + signal.SIGINT
    assert has_checkpoint(folder, cell)


def test_output_that_cannot_be_written_stops_the_cells_after_their_epoch(tmp_path: Path) -> None:
    class Unread(StudyProgress):
        def update(self, running: Any) -> None:
            super().update(running)
            if running and self._epochs[cell.id]:
                self.say("an epoch is done")

    class Full(io.StringIO):
        def write(self, text: str) -> int:
            raise OSError(errno.ENOSPC, "No space left on device")

    folder, cell = folder_in(tmp_path), small_cell(epochs=100_000)
    with pytest.raises(OSError, match="No space left"):
        run_study([cell], folder, Settings(jobs=1), Unread([cell], folder, Console(file=Full())))
    assert has_checkpoint(folder, cell)
    assert read_claim(folder.work_of(cell)) is None


@pytest.mark.slow
def test_processes_of_a_parent_that_was_killed_stop(tmp_path: Path) -> None:
    folder, cell = folder_in(tmp_path), small_cell(epochs=100_000)
    process = start(tmp_path, 100_000, jobs=1)
    wait_until(lambda: (read_claim(folder.work_of(cell)) or {}).get("epoch"))
    process.kill()
    wait_until(lambda: read_claim(folder.work_of(cell)) is None, seconds=30)
    assert has_checkpoint(folder, cell)
    process.communicate()


@pytest.mark.slow
def test_two_runs_on_one_folder_share_the_work(tmp_path: Path) -> None:
    folder, runs = folder_in(tmp_path), [start(tmp_path, 40) for _ in range(2)]
    said = [run.communicate(timeout=300)[0] for run in runs]
    assert [run.returncode for run in runs] == [0, 0], said
    for cell in cells_of(40):
        assert sum(f"{cell.id}: finished" in text for text in said) == 1
        assert first_mismatch(alone(cell, tmp_path), read_cell(folder.cell_file(cell))) == ""
        assert len(read_metadata(folder.cell_file(cell))["sessions"]) == 1
    assert all(finding.ok for finding in check_sums(folder))


@pytest.mark.slow
def test_a_dask_worker_is_killed_and_the_results_are_the_same(tmp_path: Path) -> None:
    script = textwrap.dedent("""
        import os, signal, sys, threading, time
        from pathlib import Path
        from distributed import LocalCluster
        from inbounds.study import Settings, run_study
        from inbounds.study.running.cell_lock import read_claim
        from inbounds.learning.storage import checkpoint
        from tests.study.small import folder_in
        from tests.study.running.test_many_cells import cells_of

        def kill(folder, cell):
            while not (folder.work_of(cell) / checkpoint.FILE_NAME).exists():
                time.sleep(0.02)
            os.kill(read_claim(folder.work_of(cell))["pid"], signal.SIGKILL)

        if __name__ == "__main__":
            cells, folder = cells_of(40), folder_in(Path(sys.argv[1]))
            with LocalCluster(
                n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=None, protocol="tcp"
            ) as cluster:
                killer = threading.Thread(target=kill, args=(folder, cells[0]))
                killer.start()
                summary = run_study(cells, folder, Settings(scheduler=cluster.scheduler_address))
                killer.join()
            print(sorted(report.outcome for report in summary.reports.values()))
    """)
    pytest.importorskip("distributed", reason="the extra `cluster` is not installed")
    done = run_script(script, tmp_path, timeout=400)
    assert "['finished', 'finished', 'finished']" in done.stdout, done.stdout + done.stderr
    folder = folder_in(tmp_path)
    for cell in cells_of(40):
        assert first_mismatch(alone(cell, tmp_path), read_cell(folder.cell_file(cell))) == ""
    sessions = read_metadata(folder.cell_file(cells_of(40)[0]))["sessions"]
    assert len(sessions) == 2
    assert sessions[1]["from_epoch"] > 0


def a_run(tmp_path: Path, body: str) -> str:
    """What a study says whose cells are replaced by a few lines: `attempt(cell, folder, stop, deadline)`."""
    script = textwrap.dedent("""
        import os, signal, sys, time, warnings
        from pathlib import Path
        from inbounds.study.running import many_cells
        from tests.study.small import folder_in
        from tests.study.running.test_many_cells import cells_of

        LINES

        many_cells.attempt = attempt  # a spawned process imports this module again

        if __name__ == "__main__":
            prepare()
            summary = many_cells.run_study(cells_of(1), folder_in(Path(sys.argv[1])), many_cells.Settings(jobs=2))
            print(summary.signal, sorted(report.outcome for report in summary.reports.values()))
    """).replace("LINES", textwrap.dedent(body))
    done = run_script(script, tmp_path, timeout=100)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.slow
def test_a_cell_that_warns_a_lot_ends(tmp_path: Path) -> None:
    said = a_run(
        tmp_path,
        """
        def attempt(cell, folder, stop, deadline):
            for i in range(3000):
                warnings.warn(f"warning {i % 1000} " + 10_000 * "-")  # the first twenty are more than a pipe holds
            return many_cells.CellReport("finished")

        def prepare():
            pass
        """,
    )
    assert "0 ['finished', 'finished', 'finished']" in said
    assert said.count("warning 7 ") == 3
    assert said.count("and 980 more warnings") == 3


@pytest.mark.slow
def test_a_signal_between_two_starts_stops_what_is_started(tmp_path: Path) -> None:
    said = a_run(
        tmp_path,
        """
        def attempt(cell, folder, stop, deadline):
            end = time.monotonic() + 60
            while time.monotonic() < end and not stop():
                time.sleep(0.05)
            return many_cells.CellReport("stopped" if stop() else "never told")

        def prepare():
            real, asked = many_cells.StudyFolder.state, []

            def state(folder, cell):
                asked.append(cell)
                if len(asked) == 2:  # the first cell runs, the second is about to
                    os.kill(os.getpid(), signal.SIGTERM)
                return real(folder, cell)

            many_cells.StudyFolder.state = state
        """,
    )
    assert f"{signal.SIGTERM.value} ['stopped']" in said


@pytest.mark.slow
def test_a_cell_that_cannot_be_looked_at_is_reported(tmp_path: Path) -> None:
    said = a_run(
        tmp_path,
        """
        def attempt(cell, folder, stop, deadline):
            return many_cells.CellReport("finished")

        def prepare():
            real = many_cells.StudyFolder.state

            def state(folder, cell):
                if cell.family == "beta":
                    raise PermissionError("not yours")
                return real(folder, cell)

            many_cells.StudyFolder.state = state
        """,
    )
    assert "not yours: choose other folders" in said
    assert "0 ['failed', 'finished', 'finished']" in said


@pytest.mark.slow
def test_a_full_disk_stops_a_cluster_as_it_stops_a_machine(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    distributed = pytest.importorskip("distributed", reason="the extra `cluster` is not installed")
    begun: list[str] = []

    def attempt(cell: Cell, folder: StudyFolder, stop: Callable[[], bool], deadline: float) -> CellReport:
        begun.append(cell.id)
        if len(begun) == 1:
            return CellReport("disk full", "make room")
        end = time.monotonic() + 20
        while time.monotonic() < end and not stop():
            time.sleep(0.05)
        return CellReport("stopped" if stop() else "never told")

    monkeypatch.setattr(cluster, "attempt", attempt)
    folder = folder_in(tmp_path)
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None
    ) as here:
        summary = run_study(cells_of(1), folder, Settings(scheduler=here.scheduler_address))
    assert sorted(report.outcome for report in summary.reports.values()) == [
        "disk full",
        "stopped",
        "stopped",
    ]
    assert len(begun) < 3  # the second perhaps, before the word went round
    assert summary.signal == 0
    assert not list(folder.work.glob("stop-*"))


def test_no_scheduler_there_is_one_clear_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("distributed", reason="the extra `cluster` is not installed")
    where = ["--results", str(tmp_path / "r"), "--work", str(tmp_path / "w")]
    assert study(["run", "standard-ant-*", *where, "--scheduler", "nonsense://127.0.0.1:1"]) == 1
    assert "no Dask scheduler answers at 'nonsense://127.0.0.1:1'" in capsys.readouterr().err


def test_failures_are_reported_and_the_others_go_on(tmp_path: Path) -> None:
    folder, (broken, good) = folder_in(tmp_path), cells_of(1)[:2]
    folder.cell_file(broken).parent.mkdir(parents=True)
    folder.cell_file(broken).write_text("damaged")
    run_cell(good, folder)
    progress, said = quiet([broken, good], folder)
    summary = run_study([broken, good], folder, Settings(jobs=1), progress)
    outcomes = {name: report.outcome for name, report in summary.reports.items()}
    assert outcomes == {broken.id: "failed", good.id: "was finished"}
    assert list(summary.failed) == [broken.id]
    assert f"{broken.id}: failed: " in said.getvalue()
    assert "restore it (git checkout" in said.getvalue()


def test_no_cell_is_started_when_time_is_up(tmp_path: Path) -> None:
    folder, cells = folder_in(tmp_path), cells_of(1)
    assert run_study(cells, folder, Settings(max_minutes=0), quiet(cells, folder)[0]).reports == {}


def a_pool(
    cells: list[Cell], folder: StudyFolder, **settings: Any
) -> tuple[many_cells._LocalRun, io.StringIO]:
    progress, said = quiet(cells, folder)
    return many_cells._LocalRun(cells, folder, Settings(jobs=1, **settings), progress), said


def test_a_cell_whose_process_dies_again_and_again_is_let_be(tmp_path: Path) -> None:
    cell, *others = cells_of(1)
    pool, said = a_pool(others, folder_in(tmp_path))
    for _ in range(RETRIES):
        assert pool._death(cell, -signal.SIGKILL) is None
        assert pool.waiting.popleft() == cell
    died = pool._death(cell, -signal.SIGKILL)
    assert died is not None
    assert died.outcome == "died"
    assert "SIGKILL" in died.message
    assert said.getvalue().count("going on from its last checkpoint") == RETRIES


def test_a_full_disk_starts_no_other_cell(tmp_path: Path) -> None:
    cell, *others = cells_of(1)
    pool, said = a_pool(others, folder_in(tmp_path))
    pool._report(cell, CellReport("failed", "a fault"))
    assert list(pool.waiting) == others
    pool._report(cell, CellReport("disk full", "make room"))
    assert not pool.waiting
    assert "make room" in said.getvalue()


@pytest.mark.parametrize("commit", [False, True])
def test_what_is_finished_is_committed(commit: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    committed: list[Cell] = []
    monkeypatch.setattr(
        many_cells, "commit_cell", lambda cell, folder: committed.append(cell) or "git said no"
    )
    finished, known, stopped = cells_of(1)
    pool, said = a_pool([], folder_in(tmp_path), commit=commit)
    for cell, outcome in ((finished, "finished"), (known, "was finished"), (stopped, "stopped")):
        pool._report(cell, CellReport(outcome))
    assert committed == ([finished, known] if commit else [])
    assert ("git said no" in said.getvalue()) == commit


def test_a_cell_that_may_not_be_read_is_no_damaged_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refuse(*args: Any, **more: Any) -> None:
        raise PermissionError(13, "Permission denied", "a.parquet")

    for name in ("ParquetFile", "read_schema"):
        monkeypatch.setattr(pq, name, refuse)
    for read in (store.read_cell, store.read_metadata):
        with pytest.raises(PermissionError):
            read("a.parquet")
    folder, (cell,) = folder_in(tmp_path), select(["standard-hopper-ppo-beta"])
    folder.publish(dict.fromkeys(folder.files(cell), b""))  # nothing but reading shows what is in them
    assert study(["report", "--results", str(folder.results), "--out", str(tmp_path / "report.html")]) == 1
    said = capsys.readouterr().err
    assert "Permission denied: 'a.parquet': change its permissions" in said


def test_status(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder, cells = folder_in(tmp_path), cells_of(1)
    run_cell(cells[0], folder)
    run_cell(small_cell(family="beta", epochs=5), folder, stop=lambda: True)
    with CellLock.take(folder.work_of(cells[2])):
        assert [cell_status(cell, folder) for cell in cells] == ["finished", "begun", "running"]
        Console(width=100).print(status_table(cells, folder))
    assert re.search(r"test\s+│ Hopper │ 1\s+│ 1\s+│ 1\s+│\s+│\s+│", capsys.readouterr().out)


def test_commit_takes_the_cell_and_nothing_else(tmp_path: Path) -> None:
    folder, (cell, other, _) = folder_in(tmp_path), cells_of(1)

    def git(*args: str) -> str:
        return subprocess.run(
            ["git", "-C", str(tmp_path), *args], capture_output=True, text=True, check=True
        ).stdout

    git("init")
    for key, value in (("user.name", "Test"), ("user.email", "test@example.org")):
        git("config", key, value)
    run_cell(cell, folder)
    (tmp_path / "staged").touch()
    git("add", "staged")
    assert commit_cell(cell, folder) == ""
    assert git("show", "--name-only", "--format=%s").split("\n") == [
        f"Add study cell {cell.id}",
        "",
        f"results/cells/{cell.id}.parquet",
        "results/checksums.txt",
        "",
    ]
    before = git("rev-parse", "HEAD")
    assert commit_cell(cell, folder) == ""  # git has it
    assert git("rev-parse", "HEAD") == before
    run_cell(other, folder)
    (tmp_path / ".git" / "index.lock").touch()
    assert "did not commit it" in commit_cell(other, folder)
    (tmp_path / ".git" / "index.lock").unlink()
    assert commit_cell(other, folder) == ""  # the next time
    assert git("show", "--name-only", "--format=%s").startswith(f"Add study cell {other.id}\n")


def test_the_command_line_names_the_fix(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert study(["status", "no-such-cell"]) == 2
    assert "no cell matches no-such-cell: use an arm" in capsys.readouterr().err
    assert study(["verify", "--results", str(tmp_path)]) == 1
    said = capsys.readouterr().out
    assert said.startswith("looking into the files")
    assert "nothing is finished here: another --results?" in said
    with pytest.raises(SystemExit):
        study(["--help"])
    assert "{run,resume,status,evaluate,report,ledger,verify,dial}" in capsys.readouterr().out
    for wrong in ("--random=-1", "--epochs 0"):
        assert study(["verify", *wrong.split()]) == 2
        assert "--random takes 0 or more cells" in capsys.readouterr().err
    for wrong in ("--jobs 0", "--nice 20"):
        assert study(["run", "standard", *wrong.split()]) == 2
        assert f"{wrong.split()[0][2:]} must be" in capsys.readouterr().err
    assert study(["run", "standard", "--commit", "--scheduler", "tcp://127.0.0.1:1"]) == 2
    assert "leave commit or scheduler out" in capsys.readouterr().err
    for command in ("verify", "ledger"):
        assert study([command, "--results", str(tmp_path / "elsewhere")]) == 2
        assert "go to the source tree, or name it with --results" in capsys.readouterr().err
    assert study(["status", "--results", str(tmp_path / "elsewhere")]) == 0
    assert "go to the source tree" in capsys.readouterr().out


@pytest.mark.parametrize(
    "wrong", [{"jobs": 0}, {"nice": 20}, {"max_minutes": math.nan}, {"max_minutes": -1.0}], ids=str
)
def test_settings_are_checked(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=f"{next(iter(wrong))} must be"):
        Settings(**wrong)
