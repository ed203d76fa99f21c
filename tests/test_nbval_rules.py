"""A notebook that was executed for the book is compared, and not executed again; any other one is executed."""

import subprocess
import sys
from pathlib import Path

import nbformat
import pytest
from jupyter_cache import get_cache
from nbformat.v4 import new_code_cell, new_notebook, new_output

ROOT = Path(__file__).resolve().parents[1]
CELLS = ["from pathlib import Path", "Path('ran').touch()", "print(1 + 1)"]


def notebook(said: str, source: str = CELLS[2], *, fails: bool = False) -> nbformat.NotebookNode:
    """A notebook whose last cell says something, and whose second leaves a trace where it is executed."""
    error = [new_output("error", ename="ValueError", evalue="", traceback=["it went wrong"])] * fails
    cells = [
        new_code_cell(CELLS[0], execution_count=1),
        new_code_cell(CELLS[1], execution_count=2, outputs=error),
        new_code_cell(
            source, execution_count=3, outputs=[new_output("stream", name="stdout", text=f"{said}\n")]
        ),
    ]
    kernel = {"name": "python3", "display_name": "Python 3", "language": "python"}
    return new_notebook(cells=cells, metadata={"kernelspec": kernel})


def outcome(folder: Path, stored: nbformat.NotebookNode, executed: nbformat.NotebookNode) -> tuple[int, str]:
    """nbval's exit status on a stored notebook, and what it said, with another one in the cache."""
    path = folder / "one.ipynb"
    nbformat.write(executed, path)
    get_cache(folder / "cache").cache_notebook_file(str(path), overwrite=True, check_validity=False)
    nbformat.write(stored, path)
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "tests.nbval_rules"]
    done = subprocess.run(
        [*command, "--nbval", f"--executed={folder / 'cache'}", str(path)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    return done.returncode, done.stdout


@pytest.mark.slow
def test_what_was_executed_is_compared(tmp_path: Path) -> None:
    status, said = outcome(tmp_path, notebook("2"), notebook("2"))
    assert (status, "3 passed" in said) == (0, True), said
    status, said = outcome(tmp_path, notebook("2"), notebook("3"))
    assert (status, "1 failed, 2 passed" in said) == (1, True), said
    status, said = outcome(tmp_path, notebook("2"), notebook("2", fails=True))
    assert (status, "it went wrong" in said) == (1, True), said
    assert not (tmp_path / "ran").exists()


@pytest.mark.slow
def test_what_was_changed_since_is_executed(tmp_path: Path) -> None:
    status, said = outcome(tmp_path, notebook("2", "print(1 + 2)"), notebook("2"))
    assert (status, "1 failed, 2 passed" in said) == (1, True), said
    assert (tmp_path / "ran").exists()
