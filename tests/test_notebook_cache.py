"""Each notebook is executed once; what failed is executed again; who fills the cache and is ended leaves nothing."""

import importlib.util
import json
import os
import re
import signal
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
    for _ in range(2):
        cache = notebook_cache.fill("now")
    told = capsys.readouterr().out
    said = re.findall(r"of (\d)  (\w+\.ipynb(?: failed)?)  ", told)
    assert (sorted(said[:2]), said[2:]) == (
        [("2", "bad.ipynb failed"), ("2", "good.ipynb")],
        [("1", "bad.ipynb failed")],
    )
    assert "\n1 of 2 failed: bad.ipynb\n" in told
    assert [len(file.read_text(encoding="utf8").split()) for file in (good, bad)] == [1, 2]
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
    # The cache has the first as it was; who has read the other one runs again, though its own cells are known.
    write(tree, "first", "# ")
    assert executed() == executed() == [2, 3, 3, 4, 2]


@pytest.mark.slow
def test_two_notebooks_that_go_back_apart_are_not_taken_for_what_they_were(tree: Path) -> None:
    """The second one's cells are known, but were executed with the first as it was before."""
    start = 'programs.start(globals(), "first")'
    second = write(tree, "second", f"# {start}")
    write(tree, "first", "# one")
    notebook_cache.fill("now")
    write(tree, "first", "# other")
    write(tree, "second", f"# {start} too")
    notebook_cache.fill("now")
    write(tree, "second", f"# {start}")
    notebook_cache.fill("now")
    assert len(second.read_text(encoding="utf8").split()) == 3


@pytest.mark.slow
def test_outputs_that_were_not_written_to_their_end_are_made_again(tree: Path) -> None:
    """A record is there before its file, and both before what says that they are whole."""
    files = [write(tree, name) for name in ("cut", "lost")]
    notes = notebook_cache.fill("now") / "read_of_others.json"
    notes.write_text("{", encoding="utf8")
    for path in notes.parent.glob("executed/*/base.ipynb"):
        if "lost.txt" in path.read_text(encoding="utf8"):
            path.unlink()
    for _ in range(2):
        notebook_cache.fill("now")
    assert [len(file.read_text(encoding="utf8").split()) for file in files] == [2, 2]


def test_the_last_three_folders_stay(tree: Path) -> None:
    cached, drawn = tree / "_build" / ".jupyter_cache", tree / "_build" / ".doctrees"
    there = []
    for code in ("one", "two", "three", "one", "four", "four"):
        drawn.mkdir(exist_ok=True, parents=True)
        notebook_cache.fill(code)
        there.append((sorted(path.name for path in cached.iterdir()), drawn.exists()))
        time.sleep(0.02)  # the files' clock is coarse
    assert there == [
        (["one"], False),
        (["one", "two"], False),
        (["one", "three", "two"], False),
        (["one", "three", "two"], False),
        (["four", "one", "three"], False),
        (["four", "one", "three"], True),
    ]


@pytest.mark.slow
def test_what_took_longest_begins_first(tree: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(notebook_cache, "AT_ONCE", 1)
    began = tree / "began"
    for name in ("brief", "long", "new"):
        write(tree, name, f"open({str(began)!r}, 'a').write('{name} ')")
    (tree / ".cache").mkdir()
    noted = tree / ".cache" / "seconds.json"
    noted.write_text('{"brief.ipynb": 1, "long.ipynb": 100}', encoding="utf8")
    notebook_cache.fill("now")
    assert began.read_text(encoding="utf8") == "new long brief "
    assert all(0 < seconds < 99 for seconds in json.loads(noted.read_text(encoding="utf8")).values())


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
@pytest.mark.parametrize("by", ["an end", "Ctrl-C"])
def test_who_is_ended_leaves_no_process(tree: Path, by: str) -> None:
    """Ctrl-C comes to all processes at once; none of the other notebooks is taken up then."""
    file = write(tree, "long", "import time; time.sleep(600)")
    others = [write(tree, f"other{number}") for number in range(4)]
    (tree / ".cache").mkdir()
    seconds = {"long.ipynb": 100} | {f"{other.stem}.ipynb": 1 for other in others}
    (tree / ".cache" / "seconds.json").write_text(json.dumps(seconds), encoding="utf8")
    code = (
        "import forked_kernels, notebook_cache, signal, sys; from pathlib import Path; forked_kernels.LIBRARIES = [];"
        "signal.signal(signal.SIGINT, signal.default_int_handler);"  # in a shell's background it would be ignored
        "notebook_cache.ROOT = Path(sys.argv[1]); notebook_cache.BUILD = notebook_cache.ROOT / '_build';"
        "notebook_cache.AT_ONCE = 1; notebook_cache.fill('now')"
    )
    tools = str(Path(notebook_cache.__file__).parent)
    environment = os.environ | {"PYTHONPATH": tools}
    with subprocess.Popen(
        [sys.executable, "-c", code, str(tree)], env=environment, start_new_session=True
    ) as filling:
        deadline = time.monotonic() + 120
        while not file.exists() or not file.read_text(encoding="utf8"):
            assert time.monotonic() < deadline, "the notebook never began"
            time.sleep(0.1)
        kernel = psutil.Process(int(file.read_text(encoding="utf8")))
        begun = psutil.Process(filling.pid).children(recursive=True)
        assert kernel in begun
        assert len(begun) > 2, "no worker and no fork server"
        if by == "Ctrl-C":
            os.killpg(filling.pid, signal.SIGINT)
        else:
            filling.terminate()
    while any(there(each) for each in begun):
        assert time.monotonic() < deadline, "a process outlives the one that started it"
        time.sleep(0.1)
    assert not any(other.exists() for other in others)


def test_two_fill_one_after_the_other(tree: Path) -> None:
    """The second says why it waits; the death of the first, too, lets go."""
    code = (
        "import notebook_cache, sys, time; from pathlib import Path; notebook_cache.ROOT = Path(sys.argv[1]);\n"
        "with notebook_cache.alone(), notebook_cache.alone():\n"
        "    print('has it', flush=True); time.sleep(600)"
    )
    environment = os.environ | {"PYTHONPATH": str(Path(notebook_cache.__file__).parent)}
    command = [sys.executable, "-c", code, str(tree)]
    processes = []
    try:
        for _ in range(2):
            processes.append(
                subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True, bufsize=1)
            )
            said = processes[-1].stdout.readline()
            assert ("waiting for it" in said) == (len(processes) == 2), said
        processes[0].kill()
        assert processes[1].stdout.readline() == "has it\n"
    finally:
        for process in processes:
            process.kill()
            process.communicate()


PROJECT = '[build-system]\nrequires = []\n[project]\nname = "{}"\n[tool.ruff]\nline-length = {}\n'


def test_only_what_a_notebook_can_read_counts(tree: Path) -> None:
    def code() -> str:
        return notebook_cache.digest(*notebook_cache.CODE)

    def put(name: str, text: str) -> None:
        path = tree / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf8")

    put("pyproject.toml", PROJECT.format("a", 100))
    before = code()
    put("pyproject.toml", PROJECT.format("a", 110))
    ignored = (Path(notebook_cache.__file__).parents[1] / ".gitignore").read_text(encoding="utf8").split()
    leavings = [line.strip("/") for line in ignored if line.startswith("/benchmarks/")]
    assert len(leavings) > 5
    for name in leavings:
        name = name.replace("*/", "a/")
        put(name.replace("*", "a") if "." in name else f"{name}/a/a.json", "a")
    for name in ("results/HISTORY.md", "benchmarks/README.md", "benchmarks/results/a.svg", "_toc.yml"):
        put(name, "a")
    assert code() == before
    found = {before}
    for name in (
        "src/a.md",
        "results/PROTOCOL.md",
        "results/checksums.txt",
        "results/cells/a.parquet",
        "benchmarks/a.py",
        "benchmarks/results/a.json",
        "benchmarks/results/anchor/curves.parquet",
        "benchmarks/results/engines/a/engines.json",
        "constraints.txt",
    ):
        put(name, "a")
        found.add(code())
    put("pyproject.toml", PROJECT.format("b", 110))
    assert len(found | {code()}) == 11


def test_who_reads_the_contents_runs_again_with_them(tree: Path) -> None:
    write(tree, "reads", 'open("../_toc.yml")')
    write(tree, "alone")
    (tree / "_toc.yml").write_text("root: a", encoding="utf8")
    paths = [tree / "notebooks" / f"{name}.ipynb" for name in ("reads", "alone")]
    before = [notebook_cache.read_of_others(path) for path in paths]
    (tree / "_toc.yml").write_text("root: b", encoding="utf8")
    after = [notebook_cache.read_of_others(path) for path in paths]
    assert (before[0] != after[0], before[1], after[1]) == (True, "", "")


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
