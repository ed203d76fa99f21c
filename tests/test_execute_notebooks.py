"""What `make notebooks` stores is whole and without pictures, also where a later notebook fails."""

import errno
from pathlib import Path

import execute_notebooks
import nbformat
import notebook_hook
import pytest
from nbclient.exceptions import CellExecutionError
from nbformat.v4 import new_code_cell, new_notebook, new_output

KERNEL = {"name": "python3", "display_name": "Python 3", "language": "python"}
RICH = "from IPython.display import display; display({'text/plain': 'a', 'text/html': '<b>a</b>'}, raw=True)"


def write(path: Path, source: str) -> Path:
    nbformat.write(new_notebook(cells=[new_code_cell(source)], metadata={"kernelspec": KERNEL}), path)
    return path


@pytest.mark.slow
def test_who_was_executed_before_a_failure_is_stored_without_pictures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    good, bad = write(tmp_path / "good.ipynb", RICH), write(tmp_path / "bad.ipynb", "1 / 0")
    failing = bad.read_bytes()
    monkeypatch.setattr(execute_notebooks.forked_kernels, "use", lambda: None)
    monkeypatch.setattr("sys.argv", ["execute_notebooks.py", str(good), str(bad)])
    with pytest.raises(CellExecutionError):
        execute_notebooks.main()
    assert nbformat.read(good, 4).cells[0].outputs[0].data == {"text/plain": "a"}
    assert notebook_hook.main(["--check", str(good)]) == 0
    assert bad.read_bytes() == failing


def test_a_full_disk_leaves_what_was_stored(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    output = new_output("display_data", {"text/plain": "a", "text/html": "<b>a</b>"})
    cell = new_code_cell("pass", execution_count=1, outputs=[output])
    nbformat.write(new_notebook(cells=[cell]), tmp_path / "a.ipynb")
    before = (tmp_path / "a.ipynb").read_bytes()

    def full(handle: int) -> None:
        raise OSError(errno.ENOSPC, "no space left")

    with monkeypatch.context() as patched:
        patched.setattr("os.fsync", full)
        with pytest.raises(OSError, match="no space"):
            notebook_hook.main(["--write", str(tmp_path / "a.ipynb")])
    assert (tmp_path / "a.ipynb").read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["a.ipynb"]
    assert notebook_hook.main(["--write", str(tmp_path / "a.ipynb")]) == 0
    assert "text/html" not in (tmp_path / "a.ipynb").read_text(encoding="utf8")
