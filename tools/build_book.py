"""Build the HTML book: execute the notebooks, run Jupyter Book strictly, print the path of the first page.

    python tools/build_book.py            only what changed (seconds when nothing did)
    python tools/build_book.py --force    from nothing
    python tools/build_book.py --zip      put the built book into dist/in-bounds-VERSION.zip

Jupyter Book executes one notebook after another. So what its cache lacks is executed beforehand, several at a time
(`notebook_cache.py`).

Formulas are set once the pages stand, and the live robot is added. Both need packages from npm. Where npm cannot be
reached MathJax sets the formulas in the reader's browser, and the book has films in the robot's place; the next run
tries again.
"""

import argparse
import hashlib
import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import notebook_cache
from notebook_cache import BUILD, CODE, ROOT, digest

INDEX = BUILD / "html" / "index.html"
STAMP = BUILD / "built-from"
DRAWN_BY = BUILD / "drawn-by"
DRAWN_ANEW = ("book/_ext", "_toc.yml")
"""What every page depends on, with all titles: Sphinx draws again only the pages whose own text has changed."""
LIVE = BUILD / "live"  # what the live robot loads, copied into the book
PAGES = (
    "book",
    "notebooks",
    "tests",  # the page of statements shows some
    "tools/build_book.py",
    "tools/forked_kernels.py",
    "tools/notebook_cache.py",
    "tools/student_copies.py",
    "results/PROTOCOL-2.md",  # for download, like the first study's, which CODE has
    "results/HISTORY.md",
    "CITATION.cff",
    "_config.yml",
    "_toc.yml",
)


def build(code: str, wanted: str) -> int:
    """Execute the notebooks and run Jupyter Book, both told that the output is a static page.

    Args:
        code: digest of what the notebooks' outputs depend on.
        wanted: what the pages shall be drawn by, as `drawn_by` says it.
    """
    STAMP.unlink(missing_ok=True)
    same = DRAWN_BY.exists() and DRAWN_BY.read_text() == wanted
    DRAWN_BY.unlink(
        missing_ok=True
    )  # an unchanged page does not warn again, nor is it drawn after an interruption
    cache = notebook_cache.fill(code)
    os.environ |= {"INBOUNDS_BOOK_BUILD": "1", "INBOUNDS_NB_CACHE": str(cache)}
    command = [
        str(Path(sys.executable).with_name("jupyter-book")),
        "build",
        str(ROOT),
        "--path-output",
        str(ROOT),
    ]
    command += ["--warningiserror", "--nitpick", "--keep-going", "-q", *([] if same else ["--all"])]
    return subprocess.run(command, cwd=ROOT, check=False).returncode


def drawn_by() -> str:
    """Return a digest of what every page shows of the others: the extensions, the contents, and all titles."""
    titles = []
    for path in sorted([*(ROOT / "book").glob("*.md"), *(ROOT / "notebooks").glob("*.ipynb")]):
        text = path.read_text(encoding="utf8")
        if path.suffix == ".ipynb":
            text = "\n".join("".join(cell["source"]) for cell in json.loads(text)["cells"])
        titles.append(next((line for line in text.splitlines() if line.startswith("# ")), path.name))
    return f"{digest(*DRAWN_ANEW)} {hashlib.sha256(chr(10).join(titles).encode()).hexdigest()[:16]}"


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

    with notebook_cache.alone():
        return bring_up_to_date(args.force, args.zip)


def bring_up_to_date(force: bool, to_zip: bool) -> int:
    """Build what has changed, say what was done, and return the exit status."""
    if force:
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
        wanted = drawn_by()  # as it is now: a title that is edited meanwhile is not drawn
        if status := build(code, wanted):
            print(
                "\nThe book was NOT built: see the messages above (a warning counts as an error).",
                file=sys.stderr,
            )
            return status
        import student_copies  # not above: it takes a second, and mostly nothing changed

        student_copies.write_downloads(ROOT / "notebooks", INDEX.parent)
        stamp(everything, finish())
        DRAWN_BY.write_text(wanted)
        print(f"Built in {time.perf_counter() - start:.0f} s.")
    if to_zip:
        print(f"Zipped: {zip_book()}")
    print(f"Open {INDEX}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
