"""Notebooks executed once: the book shows what they put out (`make book`), nbval compares it (`make test`).

Jupyter's cache knows an executed notebook by its cells alone. A chapter also depends on the package, the data and the
pinned versions, so a cache lives in a folder named by a digest of those: change one and every notebook runs again. And
some read other notebooks while they run (`read_of_others`): they run again when one of those has changed.
"""

import hashlib
import json
import os
import re
import shutil
import sys
import threading
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
BUILD = ROOT / "_build"
AT_ONCE = min(4, os.cpu_count() or 1)  # notebooks; each takes one core and up to 1 GB
CODE = (
    "src",
    "results",
    "benchmarks",
    "_toc.yml",
    "constraints.txt",
    "pyproject.toml",
)
"""What a notebook's output depends on, besides its cells."""


def digest(*names: str) -> str:
    """Return a digest of files and folders below ROOT, without what is hidden and what Python leaves behind."""
    total = hashlib.sha256(sys.version.encode())
    for name in names:
        base = ROOT / name
        for path in sorted(base.rglob("*")) if base.is_dir() else [base]:
            inside = path.relative_to(ROOT).parts
            if path.is_file() and "__pycache__" not in inside and not any(p.startswith(".") for p in inside):
                total.update(str(path.relative_to(ROOT)).encode() + b"\0" + path.read_bytes())
    return total.hexdigest()[:16]


def read_of_others(path: Path) -> str:
    """Return a digest of the notebooks that a notebook reads while it runs, nothing where it reads none.

    One that continues a program reads the chapters before it; one that counts pages reads all.
    """

    def earlier(notebook: Path) -> list[Path]:
        text = notebook.read_text(encoding="utf8")
        names = re.findall(r'programs\.start\(globals\(\), \\"(\w+)\\"', text)
        found = [notebook.with_name(f"{name}.ipynb") for name in names]
        return [*found, *(each for one in found for each in earlier(one))]

    if "count_page(" in path.read_text(encoding="utf8"):
        return digest("notebooks")
    continued = [f"notebooks/{each.name}" for each in earlier(path)]
    return digest(*continued) if continued else ""


def fill(code: str) -> Path:
    """Execute what the cache of this digest lacks, as for the book's pages, and return its folder.

    What fails is not cached: who needs it runs it again, and says what is wrong.
    """
    import yaml  # not above, like the cache: mostly nothing changed, and then neither is needed
    from jupyter_cache import get_cache

    cache = BUILD / ".jupyter_cache" / code
    for stale in cache.parent.glob("*"):
        if stale != cache:
            # Pages keep their outputs in pickled doctrees, which know nothing of the package either.
            shutil.rmtree(stale)
            shutil.rmtree(BUILD / ".doctrees", ignore_errors=True)
    cache.mkdir(parents=True, exist_ok=True)
    timeout = yaml.safe_load((ROOT / "_config.yml").read_text())["execute"]["timeout"]  # of a cell, seconds
    project, start = get_cache(cache), time.perf_counter()
    paths = sorted((ROOT / "notebooks").glob("*.ipynb"))
    read, noted = {path.name: read_of_others(path) for path in paths}, cache / "read_of_others.json"
    before = json.loads(noted.read_text(encoding="utf8")) if noted.exists() else {}
    keys = {}
    for path in paths:
        try:
            known = project.match_cache_file(str(path))
            if before.get(path.name, "") == read[path.name]:
                continue
            project.remove_cache(known.pk)
            page = BUILD / ".doctrees" / "notebooks" / path.with_suffix(".doctree").name
            page.unlink(missing_ok=True)  # Sphinx draws a page again whose doctree is gone
        except KeyError:
            pass
        keys[path.name] = project.add_nb_to_project(str(path)).pk
    if not keys:
        return cache
    at_once = min(AT_ONCE, len(keys))
    with ProcessPoolExecutor(at_once, initializer=_start, initargs=(os.getpid(),)) as pool:
        running = {pool.submit(_execute, str(cache), key, timeout): name for name, key in keys.items()}
        for count, done in enumerate(as_completed(running), 1):
            done.result()
            print(
                f"{count:3d} of {len(keys)}  {running[done]}  ({time.perf_counter() - start:.0f} s)",
                flush=True,
            )
    noted.write_text(json.dumps(read), encoding="utf8")
    return cache


def _start(parent: int) -> None:
    """Prepare a process that executes: its outputs are for a page, and it ends when its parent does."""
    import forked_kernels

    forked_kernels.use()
    os.environ["INBOUNDS_BOOK_BUILD"] = "1"

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(1)
        os._exit(1)  # its kernel watches it, in turn

    threading.Thread(target=watch, daemon=True).start()


def _execute(cache: str, key: int, timeout: int) -> None:
    """Execute a notebook of the cache's project; called in a process of its own."""
    from jupyter_cache import get_cache
    from jupyter_cache.executors import load_executor

    project = get_cache(cache)
    # With several processes it deletes as old what another one adds between its two questions to the database.
    project.truncate_caches = lambda: None
    load_executor("local-serial", project).run_and_cache(filter_pks=[key], timeout=timeout)
