"""Notebooks executed once: the book shows what they put out (`make book`), nbval compares it (`make test`).

Jupyter's cache knows an executed notebook by its cells alone. A chapter also depends on the package, the data and the
pinned versions, so a cache lives in a folder named by a digest of those: change one and every notebook runs again. The
last three such folders stay, so that a change that is taken back costs nothing. And some notebooks read others, or the
table of contents, while they run (`read_of_others`): they run again when one of those has changed.
"""

import contextlib
import hashlib
import json
import multiprocessing
import os
import re
import shutil
import signal
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
BUILD = ROOT / "_build"
AT_ONCE = min(4, os.cpu_count() or 1)  # notebooks; each takes one core and up to 1 GB
KEPT = 3
"""How many digests' folders stay; one takes about 25 MB."""
CODE = (
    "src",
    "results",
    "!results/*.md",  # prose, but for the file that tells a study's folder
    "results/PROTOCOL.md",
    "benchmarks",
    "!benchmarks/*.md",
    "!benchmarks/*.svg",
    "!benchmarks/results/quick/*",  # this and what follows is in .gitignore, too
    "!benchmarks/results/some/*",
    "!benchmarks/results/*/quick/*",
    "!benchmarks/results/*/runs/*",
    "!benchmarks/results/engines/*.parquet",
    "constraints.txt",
    "pyproject.toml",
)
"""What a notebook's output depends on, besides its cells and `read_of_others`; see `digest`."""
INSTALLED = ("build-system", "project")
"""Tables of pyproject.toml that say what is installed; the others set up the tools of who writes the book."""


def digest(*names: str) -> str:
    """Return a digest of files and folders below ROOT, without what is hidden and what Python leaves behind.

    A name that begins with `!` is a pattern of what is left out of the folders; its `*` goes across folders.
    """
    left_out = [name[1:] for name in names if name.startswith("!")]
    total = hashlib.sha256(sys.version.encode())
    for name in names:
        base = ROOT / name
        for path in sorted(base.rglob("*")) if base.is_dir() else [base]:
            inside = path.relative_to(ROOT)
            if "__pycache__" in inside.parts or any(part.startswith(".") for part in inside.parts):
                continue
            if path != base and any(fnmatchcase(inside.as_posix(), pattern) for pattern in left_out):
                continue
            if path.is_file():
                total.update(str(inside).encode() + b"\0" + _content(path))
    return total.hexdigest()[:16]


def _content(path: Path) -> bytes:
    """Return what counts of a file: all of it, but of pyproject.toml only what is installed."""
    if path != ROOT / "pyproject.toml":
        return path.read_bytes()
    import tomllib  # not above: nobody else needs it

    tables = tomllib.loads(path.read_text(encoding="utf8"))
    return repr([tables.get(table) for table in INSTALLED]).encode()


def read_of_others(path: Path) -> str:
    """Return a digest of what a notebook reads of the book while it runs, nothing where it reads none of it.

    One that continues a program reads the chapters before it; one that counts pages reads all.
    """

    def earlier(notebook: Path) -> list[Path]:
        text = notebook.read_text(encoding="utf8")
        names = re.findall(r'programs\.start\(globals\(\), \\"(\w+)\\"', text)
        found = [notebook.with_name(f"{name}.ipynb") for name in names]
        return [*found, *(each for one in found for each in earlier(one))]

    text = path.read_text(encoding="utf8")
    every = "count_page(" in text
    names = ["notebooks"] if every else [f"notebooks/{each.name}" for each in earlier(path)]
    if "_toc.yml" in text:
        names.append("_toc.yml")
    return digest(*names) if names else ""


@contextlib.contextmanager
def alone() -> Iterator[None]:
    """Hold what is executed and built, against every other process; who has to wait says so.

    Who holds it may hold it again. The death of a process lets go of it. The file is not in BUILD, which may be removed
    by who holds it.
    """
    from filelock import FileLock, Timeout  # not `inbounds`, which would bring all of PyTorch

    path = ROOT / ".cache" / "building.lock"
    path.parent.mkdir(exist_ok=True)
    lock = FileLock(path, is_singleton=True, fallback_to_soft=False)
    try:
        lock.acquire(blocking=False)
    except Timeout:
        print("Another command executes the notebooks or builds the book here: waiting for it.", flush=True)
        lock.acquire()
    try:
        yield
    finally:
        lock.release()


def fill(code: str) -> Path:
    """Execute what the cache of this digest lacks, as for the book's pages, and return its folder.

    What fails is not cached: who needs it runs it again, and says what is wrong.
    """
    with alone():
        return _fill(_folder(code))


def _folder(code: str) -> Path:
    """Return the folder of a digest, now the latest of those that are kept."""
    folder, last = BUILD / ".jupyter_cache" / code, BUILD / "executed-with"
    folder.mkdir(parents=True, exist_ok=True)
    os.utime(folder)
    others = sorted(
        (path for path in folder.parent.iterdir() if path.is_dir() and path != folder),
        key=lambda path: path.stat().st_mtime,
        reverse=True,
    )
    for old in others[KEPT - 1 :]:
        shutil.rmtree(old)
    if not last.exists() or last.read_text(encoding="utf8") != code:
        # Pages keep their outputs in pickled doctrees, which know nothing of the package either.
        shutil.rmtree(BUILD / ".doctrees", ignore_errors=True)
        last.write_text(code, encoding="utf8")
    return folder


def _fill(cache: Path) -> Path:
    """Execute what this folder lacks, and return it."""
    import yaml  # not above, like the cache: mostly nothing changed, and then neither is needed
    from jupyter_cache import get_cache

    timeout = yaml.safe_load((ROOT / "_config.yml").read_text())["execute"]["timeout"]  # of a cell, seconds
    project, start, failed = get_cache(cache), time.perf_counter(), []
    # What was read is noted for the cells, not for the file: the cache may have both as they were some edits ago. It
    # is noted once the outputs are written: who was ended before may have left a record without them.
    notes, lasted = cache / "read_of_others.json", ROOT / ".cache" / "seconds.json"
    noted, seconds = _noted(notes), _noted(lasted)
    paths = {path.name: path for path in sorted((ROOT / "notebooks").glob("*.ipynb"))}
    states = {name: _state(project, path) for name, path in paths.items()}
    lacking = [name for name, state in states.items() if not _has(project, *state, noted)]
    keys = {}
    # The longest first, so that none is left alone at the end; before them those that nobody has timed.
    for name in sorted(lacking, key=lambda name: -seconds.get(name, float("inf"))):
        page = BUILD / ".doctrees" / "notebooks" / paths[name].with_suffix(".doctree").name
        page.unlink(missing_ok=True)  # Sphinx draws a page again whose doctree is gone
        keys[name] = project.add_nb_to_project(str(paths[name])).pk
    if not keys:
        return cache
    with _processes(min(AT_ONCE, len(keys))) as pool:
        running = {pool.submit(_execute, str(cache), key, timeout): name for name, key in keys.items()}
        for count, done in enumerate(as_completed(running), 1):
            name, (well, took) = running[done], done.result()
            said = f"{count:3d} of {len(keys)}  {name}{'' if well else ' failed'}"
            print(f"{said}  ({time.perf_counter() - start:.0f} s)", flush=True)
            if not well:
                failed.append(name)
                continue
            seconds[name] = round(took, 1)
            _note(lasted, seconds)
            with contextlib.suppress(OSError, ValueError):  # somebody is writing it just now
                if _state(project, paths[name]) == states[name]:  # nobody has edited it meanwhile
                    noted.update([states[name]])
                    _note(notes, noted)
    if failed:
        print(f"{len(failed)} of {len(keys)} failed: {', '.join(sorted(failed))}", flush=True)
    return cache


def _state(project: Any, path: Path) -> tuple[str, str]:
    """Return the cache's digest of a notebook's cells, and a digest of what it reads of others."""
    import nbformat

    notebook = nbformat.read(path, nbformat.NO_CONVERT)
    return project.create_hashed_notebook(notebook)[1], read_of_others(path)


def _has(project: Any, cells: str, read: str, noted: dict[str, Any]) -> bool:
    """Return whether a cache has the outputs of these cells; what it has of them that does not hold is removed."""
    from jupyter_cache.cache.db import NbCacheRecord

    try:
        known = NbCacheRecord.record_from_hashkey(cells, project.db)
    except KeyError:
        return False
    if noted.get(cells) == read:
        return True
    # Not by `remove_cache`, which refuses where only the file is missing.
    shutil.rmtree(Path(project.path) / "executed" / cells, ignore_errors=True)
    NbCacheRecord.remove_records([known.pk], project.db)
    return False


@contextlib.contextmanager
def _processes(count: int) -> Iterator[ProcessPoolExecutor]:
    """Have processes that execute notebooks; when we are interrupted they end at once, and begin no other."""
    pool = ProcessPoolExecutor(count, initializer=_start, initargs=(os.getpid(),))
    try:
        yield pool
    except BaseException:
        # Ctrl-C comes to each of them, too: it would take that for the failure of a notebook, and take up the next.
        for worker in multiprocessing.active_children():
            worker.kill()  # its kernel ends with it
        raise
    finally:
        pool.shutdown(cancel_futures=True)


def _noted(path: Path) -> dict[str, Any]:
    """Return what was noted in a file; where that is missing or damaged, nothing."""
    try:
        found = json.loads(path.read_text(encoding="utf8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def _note(path: Path, what: dict[str, Any]) -> None:
    """Write a file of notes, which is the old one or the new one whenever this process ends."""
    new = path.with_suffix(".new")
    new.write_text(json.dumps(what), encoding="utf8")
    new.replace(path)


def _start(parent: int) -> None:
    """Prepare a process that executes: its outputs are for a page, and it ends when its parent does."""
    import forked_kernels

    signal.signal(signal.SIGINT, lambda *_: None)  # Ctrl-C comes to all; the parent ends this process
    forked_kernels.use()
    os.environ["INBOUNDS_BOOK_BUILD"] = "1"

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(1)
        os._exit(1)  # its kernel watches it, in turn

    threading.Thread(target=watch, daemon=True).start()


def _execute(cache: str, key: int, timeout: int) -> tuple[bool, float]:
    """Execute a notebook of the cache's project; return whether all went well, and the seconds that it took.

    Called in a process of its own.
    """
    from jupyter_cache import get_cache
    from jupyter_cache.executors import load_executor

    start, project = time.perf_counter(), get_cache(cache)
    # With several processes it deletes as old what another one adds between its two questions to the database.
    project.truncate_caches = lambda: None
    result = load_executor("local-serial", project).run_and_cache(filter_pks=[key], timeout=timeout)
    return bool(result.succeeded), time.perf_counter() - start
