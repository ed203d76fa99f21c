"""`inbounds grade`: what the graders say to the notebooks of a class, by student and exercise."""

from __future__ import annotations

import contextlib
import csv
import importlib.util
import io
import json
import math
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.progress import track
from rich.table import Table

from inbounds.book.pages.graded import grader_shown
from inbounds.cli.errors import CommandError
from inbounds.learning.storage.whole_files import write_whole

MOST_GIGABYTES = 1e6
"""More than any machine has, and few enough to count in bytes."""


@dataclass(frozen=True)
class Grade:
    """What became of one exercise of one notebook."""

    notebook: Path
    exercise: str
    """Name of the grader."""
    mark: str
    """passed, not yet, not answered, or not reached."""
    message: str


def notebooks_in(paths: Sequence[Path]) -> list[Path]:
    """Return the notebooks that files and folders stand for, in order.

    Raises:
        CommandError: there is no such file or folder, or no notebook in it.
    """
    found: list[Path] = []
    for path in paths:
        if path.is_dir():
            inside = [p for p in path.rglob("*.ipynb") if ".ipynb_checkpoints" not in p.parts]
            if not inside:
                raise CommandError(f"{path} has no notebook in it: name the folder that the class handed in")
            found += sorted(inside)
        elif path.is_file():
            found.append(path)
        else:
            raise CommandError(f"there is no {path}: name a notebook, or a folder of notebooks")
    return list(dict.fromkeys(found))


def graders_shown(notebook: Path) -> dict[int, str]:
    """Return the graders whose judgements a notebook shows, by the cell's number, in order.

    Raises:
        ValueError: the file cannot be read, or is no notebook.
    """
    try:
        cells = json.loads(notebook.read_text(encoding="utf8"))["cells"]
        code = {n: "".join(cell["source"]) for n, cell in enumerate(cells) if cell["cell_type"] == "code"}
    except OSError as error:
        raise ValueError(f"this file cannot be read ({error.strerror or error}): ask for it again") from error
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise ValueError("this file is no notebook: ask for it again") from error
    return {n: name for n, source in code.items() if (name := grader_shown(source))}


def grade(notebook: Path, seconds: float, gigabytes: float) -> list[Grade]:
    """Run a notebook in a process of its own and return what its graders say.

    Args:
        notebook: a student's.
        seconds: after which the process is ended.
        gigabytes: that it may allocate.

    Returns:
        One grade for each cell of the notebook that shows what a grader says, in order.
    """
    try:
        wanted = graders_shown(notebook)
    except ValueError as error:
        return [Grade(notebook, "–", "not reached", str(error))]
    if not wanted:
        return [
            Grade(notebook, "–", "not reached", "this notebook calls no grader: is it one of the book's?")
        ]
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "said"
        report.touch()
        reason = _run(notebook, report, seconds, gigabytes)
        lines = report.read_text(encoding="utf8").splitlines()
    said = {found["cell"]: found for found in (json.loads(line) for line in lines if line.endswith("}"))}
    marks = {True: "passed", False: "not yet", None: "not answered"}
    return [
        Grade(notebook, name, marks[said[cell]["passed"]], said[cell]["message"])
        if cell in said
        else Grade(notebook, name, "not reached", reason)
        for cell, name in wanted.items()
    ]


def _run(notebook: Path, report: Path, seconds: float, gigabytes: float) -> str:
    """Run the notebook, and say why what it did not reach was not reached."""
    command = [sys.executable, "-m", "inbounds.cli.classroom.student", str(notebook.resolve()), str(report)]
    process = subprocess.Popen(
        [*command, str(gigabytes)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        stdin=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        process.wait(seconds)
    except subprocess.TimeoutExpired:
        return f"not reached within {seconds:g} s (--seconds)"
    finally:
        _end(process)
    if process.returncode:
        return f"not reached: the notebook's process ended with code {process.returncode} (out of memory? --gigabytes)"
    return "not reached: the grader's cell raised an error, or shows something else"


def _end(process: subprocess.Popen[bytes]) -> None:
    """End a process and, where there are process groups, what it started in its own, which may have outlived it."""
    if hasattr(os, "killpg"):
        with contextlib.suppress(ProcessLookupError, PermissionError):  # nothing living is left of its group
            os.killpg(process.pid, signal.SIGKILL)
    else:
        process.kill()
    process.wait()


def run(paths: Sequence[Path], seconds: float, gigabytes: float, out: Path | None) -> int:
    """Grade, print a table, and write it as CSV where that is asked for.

    Returns:
        0: grades are no failures of this command.

    Raises:
        CommandError: nothing to grade, or the CSV cannot be written.
        KeyboardInterrupt: somebody wants it to end; what was graded by then is printed, and written beside the CSV.
    """
    if not (0 < seconds < math.inf and 0 < gigabytes < MOST_GIGABYTES):
        raise CommandError("--seconds and --gigabytes must be positive numbers", 2)
    if not paths:
        raise CommandError("name a notebook, or a folder of them: inbounds grade handed-in", 2)
    if out is not None:
        _require_place(out)
    if importlib.util.find_spec("IPython") is None:
        raise CommandError(
            "grading runs notebooks, which needs IPython: pip install '.[book]' in the project's folder"
        )
    notebooks = notebooks_in(paths)
    grades: list[Grade] = []
    progress = Console(stderr=True)
    try:
        with _terminable():
            for notebook in track(
                notebooks, "notebooks", console=progress, transient=True, disable=not progress.is_terminal
            ):
                grades += grade(notebook, seconds, gigabytes)
    except BaseException:
        if grades:
            _tell(grades, out and out.with_name(f"{out.stem}.partial{out.suffix}"))
        raise
    _tell(grades, out)
    return 0


def _require_place(out: Path) -> None:
    """Raise unless a CSV can be written there: better now than after an hour of grading."""
    if not out.parent.is_dir():
        raise CommandError(f"there is no folder {out.parent} for the CSV: make it first")
    if out.is_dir() or not os.access(out if out.exists() else out.parent, os.W_OK):
        raise CommandError(f"{out} cannot be written: choose another --out")


@contextlib.contextmanager
def _terminable() -> Iterator[None]:
    """Take SIGTERM as Ctrl-C, so that no student's process is left behind without its limits."""
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _tell(grades: Sequence[Grade], out: Path | None) -> None:
    _print(grades)
    if out is None:
        return
    try:
        _write(grades, out)
    except OSError as error:
        raise CommandError(f"{out} could not be written: {error.strerror or error}") from error
    print(f"table: {out}")


def _print(grades: Sequence[Grade]) -> None:
    table = Table(pad_edge=False, box=None)
    for heading in ("notebook", "exercise", "mark", "what the grader says"):
        table.add_column(heading, overflow="fold")
    before = None
    for found in grades:
        name = str(found.notebook) if found.notebook != before else ""
        table.add_row(*map(escape, (name, found.exercise, found.mark, found.message)))
        before = found.notebook
    console = Console(highlight=False)
    console.print(table)
    passed = sum(found.mark == "passed" for found in grades)
    count = len({found.notebook for found in grades})
    console.print(f"{passed} of {len(grades)} exercises passed, in {count} notebook{'s' * (count > 1)}")


def _write(grades: Sequence[Grade], path: Path) -> None:
    text = io.StringIO(newline="")
    rows = csv.writer(text)
    rows.writerow(["notebook", "exercise", "mark", "message"])
    rows.writerows([found.notebook, found.exercise, found.mark, found.message] for found in grades)
    write_whole(path, text.getvalue().encode("utf8"))  # an older table stays until the new one is whole
