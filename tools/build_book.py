"""Build the HTML book: execute the notebooks, run Jupyter Book strictly, print the path of the first page.

    python tools/build_book.py            only what changed (seconds when nothing did)
    python tools/build_book.py --force    from nothing
    python tools/build_book.py --zip      put the built book into dist/in-bounds-VERSION.zip

Jupyter Book caches executed notebooks by their cells alone. A chapter also depends on the package, the data and the
pinned versions, so the cache lives in a folder named by a digest of those: change one and every notebook runs again.
Jupyter Book executes one notebook after another. So what the cache lacks is executed beforehand, several at a time.

Formulas are set once the pages stand, and the live robot is added. Both need packages from npm. Where npm cannot be
reached MathJax sets the formulas in the reader's browser, and the book has films in the robot's place; the next run
tries again.
"""

import argparse
import hashlib
import os
import shutil
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
BUILD = ROOT / "_build"
INDEX = BUILD / "html" / "index.html"
STAMP = BUILD / "built-from"
LIVE = BUILD / "live"  # what the live robot loads, copied into the book
AT_ONCE = min(4, os.cpu_count() or 1)  # notebooks; each takes one core and up to 1 GB
CODE = (
    "src",
    "results",
    "benchmarks/contestants.py",
    "benchmarks/equivalence.py",
    "benchmarks/report.py",
    "benchmarks/validate.py",
    "benchmarks/results/engines/ppo-logit-normal/engines.json",
    "benchmarks/results/live.json",
    "benchmarks/results/speed.json",
    "benchmarks/results/validation/curves.parquet",
    "benchmarks/results/validation/validation.json",
    "constraints.txt",
    "pyproject.toml",
)
PAGES = (
    "book",
    "notebooks",
    "tools/build_book.py",
    "tools/student_copies.py",
    "CITATION.cff",
    "_config.yml",
    "_toc.yml",
)


def digest(*names: str) -> str:
    """Return a digest of the contents of files and folders below ROOT, without what Python and Jupyter leave behind."""
    total = hashlib.sha256(sys.version.encode())
    for name in names:
        base = ROOT / name
        for path in sorted(base.rglob("*")) if base.is_dir() else [base]:
            if path.is_file() and not {"__pycache__", ".ipynb_checkpoints"} & set(path.parts):
                total.update(str(path.relative_to(ROOT)).encode() + b"\0" + path.read_bytes())
    return total.hexdigest()[:16]


def execute_one(cache: str, key: int, timeout: int) -> None:
    """Execute a notebook of the cache's project, unless the cache has it already; called in a process of its own."""
    from jupyter_cache import get_cache
    from jupyter_cache.executors import load_executor

    load_executor("local-serial", get_cache(cache)).run_and_cache(filter_pks=[key], timeout=timeout)


def execute(cache: Path) -> None:
    """Execute what the cache lacks. What fails is not cached: Jupyter Book runs it again, and says what is wrong."""
    import yaml  # not above, like the cache: mostly nothing changed, and then neither is needed
    from jupyter_cache import get_cache

    timeout = yaml.safe_load((ROOT / "_config.yml").read_text())["execute"]["timeout"]  # of a cell, seconds
    project, start = get_cache(cache), time.perf_counter()
    keys = {
        path.name: project.add_nb_to_project(str(path)).pk for path in (ROOT / "notebooks").glob("*.ipynb")
    }
    with ProcessPoolExecutor(AT_ONCE) as pool:
        running = {
            pool.submit(execute_one, str(cache), key, timeout): name for name, key in sorted(keys.items())
        }
        for count, done in enumerate(as_completed(running), 1):
            done.result()
            print(
                f"{count:3d} of {len(keys)}  {running[done]}  ({time.perf_counter() - start:.0f} s)",
                flush=True,
            )


def build(code: str) -> int:
    """Execute the notebooks and run Jupyter Book, both told that the output is a static page."""
    cache = BUILD / ".jupyter_cache" / code
    for stale in cache.parent.glob("*"):
        if stale != cache:
            # Pages keep their outputs in pickled doctrees, which know nothing of the package either.
            shutil.rmtree(stale)
            shutil.rmtree(BUILD / ".doctrees", ignore_errors=True)
    cache.mkdir(parents=True, exist_ok=True)
    STAMP.unlink(missing_ok=True)
    os.environ |= {"INBOUNDS_BOOK_BUILD": "1", "INBOUNDS_NB_CACHE": str(cache)}
    execute(cache)
    command = [
        str(Path(sys.executable).with_name("jupyter-book")),
        "build",
        str(ROOT),
        "--path-output",
        str(ROOT),
    ]
    return subprocess.run(
        [*command, "--warningiserror", "--nitpick", "--keep-going", "-q"], cwd=ROOT, check=False
    ).returncode


def finish() -> str:
    """Do what the pages want once they stand; return what npm would have brought, and why it did not, or nothing."""
    sys.path.insert(0, str(ROOT / "src"))
    from inbounds.book import formulas, previews  # not above: it takes seconds, and mostly nothing changed

    lines = []
    if why := formulas.write(INDEX.parent):
        lines.append(
            f"The formulas: MathJax sets them in the browser. {why}. The next `make book` tries again."
        )
    previews.write(INDEX.parent)
    if why := add_live_robot():
        lines.append(f"The live robot: films only. {why}. The next `make book` tries again.")
    return "\n".join(lines)


def add_live_robot() -> str:
    """Put the live robot's files into the built book; return why there are only films, or nothing."""
    sys.path.insert(0, str(ROOT / "src"))
    from inbounds.book.live import site  # not above: it takes seconds, and mostly nothing changed

    why = site.write(LIVE)
    target = INDEX.parent / "_static" / "live"
    shutil.rmtree(target, ignore_errors=True)
    shutil.copytree(LIVE, target)
    return why


def stamp(everything: str, why: str) -> None:
    """Note what the book was built from; what lacks something of npm's is not up to date."""
    STAMP.write_text(everything if not why else f"{everything} without npm")
    if why:
        print(why)


def zip_book() -> Path:
    """Write one file to read offline: unpack it anywhere and open index.html."""
    sys.path.insert(0, str(ROOT / "src"))
    from inbounds import __version__

    target = ROOT / "dist" / f"in-bounds-{__version__}"
    target.parent.mkdir(exist_ok=True)
    return Path(shutil.make_archive(str(target), "zip", INDEX.parent))


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--force", action="store_true", help="build from nothing")
    parser.add_argument("--zip", action="store_true", help="zip the built book into dist/")
    args = parser.parse_args()

    if args.force:
        shutil.rmtree(BUILD, ignore_errors=True)
    start, code = time.perf_counter(), digest(*CODE)
    everything = f"{code} {digest(*PAGES)}"
    built_from = STAMP.read_text() if INDEX.exists() and STAMP.exists() else ""
    if built_from == everything:
        print("The book is up to date.")
    elif built_from == f"{everything} without npm":
        print("The book is up to date, but for what npm brings.")
        stamp(everything, finish())
    else:
        print("Executing the notebooks and building the pages ...", flush=True)
        if status := build(code):
            print(
                "\nThe book was NOT built: see the messages above (a warning counts as an error).",
                file=sys.stderr,
            )
            return status
        import student_copies  # not above: it takes a second, and mostly nothing changed

        student_copies.write_downloads(ROOT / "notebooks", INDEX.parent)
        stamp(everything, finish())
        print(f"Built in {time.perf_counter() - start:.0f} s.")
    if args.zip:
        print(f"Zipped: {zip_book()}")
    print(f"Open {INDEX}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
