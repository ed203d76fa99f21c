"""Each notebook is executed once; what failed is executed again; who fills the cache and is ended leaves nothing."""

import importlib.util
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import forked_kernels
import nbformat
import notebook_cache
import psutil
import pytest
from jupyter_cache import get_cache
from jupyter_cache.cache.db import NbCacheRecord
from nbformat.v4 import new_code_cell, new_notebook

KERNEL = {"name": "python3", "display_name": "Python 3", "language": "python"}
TRACE = "import os; from pathlib import Path; Path({name!r}).open('a').write(f'{{os.getpid()}} ')"


@pytest.fixture
def tree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A tree with nothing but a folder for notebooks, and how long a cell may take."""
    monkeypatch.setattr(notebook_cache, "ROOT", tmp_path)
    monkeypatch.setattr(notebook_cache, "BUILD", tmp_path / "_build")
    monkeypatch.setattr(forked_kernels, "LIBRARIES", ["colorsys"])  # these notebooks need no other
    (tmp_path / "notebooks").mkdir()
    (tmp_path / "_config.yml").write_text("execute: {timeout: 60}", encoding="utf8")
    return tmp_path


def test_the_libraries_of_kernels_are_there() -> None:
    """A name that is not is skipped in silence, and every kernel imports it anew."""
    assert all(importlib.util.find_spec(name) for name in forked_kernels.LIBRARIES)


def write(tree: Path, name: str, *sources: str) -> Path:
    """Write a notebook that leaves its kernel's process id in a file; return the file."""
    file = tree / f"{name}.txt"
    cells = [new_code_cell(source) for source in (TRACE.format(name=str(file)), *sources)]
    nbformat.write(
        new_notebook(cells=cells, metadata={"kernelspec": KERNEL}), tree / "notebooks" / f"{name}.ipynb"
    )
    return file


def there(process: psutil.Process) -> bool:
    try:
        return process.status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


@pytest.mark.slow
def test_a_notebook_is_executed_once_and_a_failing_one_again(
    tree: Path, capsys: pytest.CaptureFixture
) -> None:
    code = "import os, sys; print(os.environ['INBOUNDS_BOOK_BUILD'], os.getcwd(), 'colorsys' in sys.modules)"
    good = write(tree, "good", code)
    bad = write(tree, "bad", "1 / 0")
    stale = tree / "_build" / ".jupyter_cache" / "before"
    stale.mkdir(parents=True)
    for _ in range(2):
        cache = notebook_cache.fill("now")
    said = re.findall(r"of (\d)  (\w+)", capsys.readouterr().out)
    assert (sorted(said[:2]), said[2:]) == ([("2", "bad"), ("2", "good")], [("1", "bad")])
    assert [len(file.read_text(encoding="utf8").split()) for file in (good, bad)] == [1, 2]
    assert not stale.exists()
    kept = get_cache(cache).list_cache_records()
    assert [Path(record.uri).stem for record in kept] == ["good"]
    assert (
        get_cache(cache).get_cache_bundle(kept[0].pk).nb.cells[1].outputs[0].text
        == f"1 {tree / 'notebooks'} True\n"
    )
    assert "INBOUNDS_BOOK_BUILD" not in os.environ


@pytest.mark.slow
def test_who_reads_another_notebook_is_executed_again_when_that_has_changed(tree: Path) -> None:
    names = ("first", "continues", "goes_on", "counts", "alone")
    start = 'programs.start(globals(), "{}")'
    files = [
        write(tree, name, f"# {line}")
        for name, line in zip(
            names, ("", start.format("first"), start.format("continues"), "count_page(", ""), strict=True
        )
    ]

    def executed() -> list[int]:
        notebook_cache.fill("now")
        return [len(file.read_text(encoding="utf8").split()) for file in files]

    assert executed() == executed() == [1, 1, 1, 1, 1]
    page = tree / "_build" / ".doctrees" / "notebooks" / "continues.doctree"
    page.parent.mkdir(parents=True)
    page.touch()
    write(tree, "first", "# other")
    assert executed() == executed() == [2, 2, 2, 2, 1]
    assert not page.exists()
    write(tree, "alone", "# other")
    assert executed() == [2, 2, 2, 3, 2]


@pytest.mark.slow
def test_nothing_is_taken_out_of_a_cache_that_is_being_filled(
    tree: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The library would delete the oldest; of what two processes add at once it takes one for old."""
    monkeypatch.setattr(NbCacheRecord, "records_to_delete", lambda keep, db: [1])
    files = [write(tree, name) for name in ("one", "two", "three")]
    for _ in range(2):
        notebook_cache.fill("now")
    assert [len(file.read_text(encoding="utf8").split()) for file in files] == [1, 1, 1]


@pytest.mark.slow
def test_who_is_ended_leaves_no_process(tree: Path) -> None:
    file = write(tree, "long", "import time; time.sleep(600)")
    code = (
        "import forked_kernels, notebook_cache, sys; from pathlib import Path; forked_kernels.LIBRARIES = [];"
        "notebook_cache.ROOT = Path(sys.argv[1]); notebook_cache.BUILD = notebook_cache.ROOT / '_build';"
        "notebook_cache.fill('now')"
    )
    tools = str(Path(notebook_cache.__file__).parent)
    environment = os.environ | {"PYTHONPATH": tools}
    with subprocess.Popen([sys.executable, "-c", code, str(tree)], env=environment) as filling:
        deadline = time.monotonic() + 120
        while not file.exists() or not file.read_text(encoding="utf8"):
            assert time.monotonic() < deadline, "the notebook never began"
            time.sleep(0.1)
        kernel = psutil.Process(int(file.read_text(encoding="utf8")))
        begun = psutil.Process(filling.pid).children(recursive=True)
        assert kernel in begun
        assert len(begun) > 2, "no worker and no fork server"
        filling.terminate()
    while any(there(each) for each in begun):
        assert time.monotonic() < deadline, "a process outlives the one that started it"
        time.sleep(0.1)


def test_a_kernel_that_has_ended_by_itself_needs_no_signal() -> None:
    """As one that was asked to shut down may have; in a process of its own, since it has one fork server."""
    code = (
        "import forked_kernels, sys; kernel = forked_kernels.ForkedKernel([sys.executable, '-m', 'colorsys'], {}, '.');"
        "print(kernel.wait(), kernel.poll(), kernel.send_signal(15))"
    )
    environment = os.environ | {"PYTHONPATH": str(Path(notebook_cache.__file__).parent)}
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False
    )
    assert done.stdout == "0 0 None\n", done.stderr
