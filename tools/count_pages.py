"""How much each page asks of its reader, and whether a core chapter keeps to its budget.

    python tools/count_pages.py                 every page; fails if a rewritten chapter asks for too much
    python tools/count_pages.py NAME ...        some pages

The budgets and the list of rewritten chapters stand in `book/budgets.toml`; what counts, and what does not, in
`src/inbounds/book/pages/counts.py`.
"""

import argparse
import re
import sys
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from inbounds.book.pages.cells import read_cells
from inbounds.book.pages.contents import contents
from inbounds.book.pages.counts import HIDDEN, Counts, count_page
from inbounds.book.pages.programs import TAG

ROOT = Path(__file__).resolve().parents[1]
CUT = {
    "words": "move what the argument does not need to a page of Going deeper",
    "lines": "move a program to a page of Going deeper, or use the package",
    "statements": "keep those that the book needs later; the others move to Going deeper",
    "intervals": "put them into a table or a figure",
}


def too_much(name: str, found: Counts, budget: Mapping[str, int]) -> Iterator[str]:
    """Say what a chapter has too much of, and what to do about it."""
    for what, cure in CUT.items():
        over = getattr(found, what) - budget[what]
        if over > 0:
            where = f' in the paragraph "{" ".join(found.fullest.split())} …"' if what == "intervals" else ""
            yield f"{name}: {getattr(found, what)} {what}{where}, {over} more than {budget[what]}: {cure}"


def misplaced(name: str, cells: list[dict[str, Any]], longest: int) -> Iterator[str]:
    """Say which check or step of a program is hidden or too long."""
    following = ""
    for number, cell in enumerate(cells):
        tags = set(cell.get("metadata", {}).get("tags", []))
        if cell["cell_type"] == "markdown":
            following = cell["source"]
            continue
        if TAG in tags and tags & HIDDEN:
            yield f"{name}: cell {number} is part of the program and hidden: show it"
        if re.search(r"\*\*Check it\b[^\n]*(?:\n[^\n]+)*\s*\Z", following):
            lines = len([line for line in cell["source"].splitlines() if line.strip()])
            if tags & HIDDEN:
                yield f"{name}: cell {number} checks a statement and is hidden: show it, and hide tolerances only"
            elif lines > longest:
                over = f"{lines - longest} more than {longest}"
                yield f"{name}: cell {number} checks in {lines} lines, {over}: draw elsewhere"
        following = ""


def complaints(root: Path, budgets: Mapping[str, Any]) -> Iterator[str]:
    """Say what keeps the rewritten chapters from their budgets.

    Args:
        root: of the book, with `_toc.yml` and `notebooks`.
        budgets: as `book/budgets.toml` has them.
    """
    rewritten, core = budgets["rewritten"], contents(root / "_toc.yml").core
    counted = {}
    for name in rewritten:
        if name not in core:
            yield f"{name}: listed as rewritten, but no core chapter of _toc.yml has this name"
            continue
        notebook = root / "notebooks" / f"{name}.ipynb"
        budget = budgets["core"] | budgets.get("chapters", {}).get(name, {})
        counted[name] = count_page(notebook)
        yield from too_much(name, counted[name], budget)
        yield from misplaced(name, read_cells(notebook), budget["check"])
    for group, limit in budgets.get("together", {}).items():
        if set(limit["chapters"]) <= set(counted):
            total = sum(counted[name].words for name in limit["chapters"])
            if total > limit["words"]:
                over = total - limit["words"]
                yield f"{group}: {total} words together, {over} more than {limit['words']}: {CUT['words']}"


def table(root: Path, budgets: Mapping[str, Any], names: list[str]) -> Iterator[str]:
    """Yield the lines of the report."""
    yield f"{'page':<28}{'kind':<12}{'words':>7}{'lines':>7}{'proofs':>8}{'intervals':>11}{'minutes':>9}"
    pages = contents(root / "_toc.yml")
    for name in names or [*pages.core, *pages.depth]:
        found = count_page(root / "notebooks" / f"{name}.ipynb")
        kind = "rewritten" if name in budgets["rewritten"] else pages.kind(name)
        yield (
            f"{name:<28}{kind:<12}{found.words:>7}{found.lines:>7}{found.statements:>8}{found.intervals:>11}"
            f"{found.minutes():>9}"
        )
    for group, limit in budgets.get("together", {}).items() if not names else ():
        done = [name for name in limit["chapters"] if name in budgets["rewritten"]]
        total = sum(count_page(root / "notebooks" / f"{name}.ipynb").words for name in done)
        yield f"{group}: {total} of {limit['words']} words, {len(done)} of {len(limit['chapters'])} chapters rewritten"


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help="of notebooks, without their ending")
    names = parser.parse_args(arguments).names
    budgets = tomllib.loads((ROOT / "book" / "budgets.toml").read_text(encoding="utf8"))
    print(*table(ROOT, budgets, names), sep="\n")
    found = list(complaints(ROOT, budgets))
    print(*found, sep="\n")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
