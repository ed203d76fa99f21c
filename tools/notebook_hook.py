"""Keep stored notebooks small and honest: text outputs only, every code cell executed in order, no errors.

    python tools/notebook_hook.py --write [NOTEBOOK ...]    strip pictures, HTML and videos, normalise the metadata
    python tools/notebook_hook.py --check [NOTEBOOK ...]    fail if a stored notebook is not as --write leaves it

Pictures and videos are made by the build. What stays is the text form of each output, which nbval compares.
"""

import argparse
import ast
import re
import sys
from collections import Counter
from pathlib import Path

import nbformat

from inbounds.book.pages.glue import ROLE, glued

ROOT = Path(__file__).resolve().parents[1]
TRUTH = re.compile(r"^:truth: *(\S+)$", re.M)
"""The name of the number that a guess is compared with (`book/_ext/guesses.py`)."""
LIGHT = ("text/plain", "application/papermill.record/text/plain")
METADATA = {
    "kernelspec": {"display_name": "Python 3 (ipykernel)", "language": "python", "name": "python3"},
    "language_info": {"name": "python"},
}

PROGRAM = "program"
"""What a chapter says of its program (`inbounds.book.pages.programs`): the one entry that is its own."""


def strip(notebook: nbformat.NotebookNode) -> nbformat.NotebookNode:
    """Drop heavy MIME types and whatever changes from one execution to the next without meaning anything."""
    own = {PROGRAM: notebook.metadata[PROGRAM]} if PROGRAM in notebook.metadata else {}
    notebook.metadata = nbformat.from_dict(METADATA | own)
    for cell in notebook.cells:
        cell.metadata.pop("execution", None)
        for output in cell.get("outputs", []):
            if "data" in output:
                output.data = {mime: text for mime, text in output.data.items() if mime in LIGHT}
                output.metadata = {k: v for k, v in output.metadata.items() if k == "scrapbook"}
    return notebook


def text_of(notebook: nbformat.NotebookNode) -> str:
    """Return the text of a stripped notebook's file."""
    nbformat.validate(notebook)
    return nbformat.writes(notebook) + "\n"


def store(path: Path, text: str) -> None:
    """Write a notebook whole: on a full disk, or when we are killed, the only copy there is stays as it was."""
    from inbounds.learning.storage.whole_files import write_whole  # not above: it brings PyTorch

    write_whole(path, text.encode())


def complaints(notebook: nbformat.NotebookNode) -> list[str]:
    """Return what keeps a stored notebook from being a faithful record of one clean run, from top to bottom."""
    found, expected = [*unknown_values(notebook), *glued_twice(notebook), *not_on_the_page(notebook)], 1
    for number, cell in enumerate(notebook.cells):
        if cell.cell_type != "code" or not cell.source.strip():
            continue
        if cell.execution_count != expected:
            found.append(f"cell {number}: execution count {cell.execution_count}, expected {expected}")
        expected += 1
        if (lines := lines_beside_imports(cell.source)) > 25:
            found.append(
                f"cell {number}: {lines} lines beside its imports; one idea a cell, 25 lines at most"
            )
        for output in cell.outputs:
            if output.output_type == "error":
                found.append(f"cell {number}: stores an error ({output.ename})")
            if output.get("name") == "stderr":
                found.append(f"cell {number}: wrote to stderr: {output.text.strip()[:80]}")
    return found


def lines_beside_imports(source: str) -> int:
    """Return how many lines a cell has that import nothing."""
    imports = [node for node in ast.parse(source).body if isinstance(node, ast.Import | ast.ImportFrom)]
    return len(source.splitlines()) - sum((node.end_lineno or 0) - node.lineno + 1 for node in imports)


def glued_twice(notebook: nbformat.NotebookNode) -> list[str]:
    """Return which names are glued more than once: the build warns of it, and its warnings are errors."""
    names = Counter(name for name, _ in glued(notebook.cells))
    return [f"glues {name!r} {count} times" for name, count in names.items() if count > 1]


def defined(tree: ast.AST) -> set[str]:
    """Return the names that a cell binds, at whatever depth: generous, because only names bound nowhere else count."""
    names = {
        node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)
    }
    names |= {node.arg for node in ast.walk(tree) if isinstance(node, ast.arg)}
    names |= {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.ClassDef)}
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)]
    return names | {alias.asname or alias.name.split(".")[0] for node in imports for alias in node.names}


def not_on_the_page(notebook: nbformat.NotebookNode) -> list[str]:
    """Return which names shown code uses that removed cells alone make: who copies it from the page lacks them."""
    shown: set[str] = set()
    removed: set[str] = set()
    found = []
    for number, cell in enumerate(notebook.cells):
        tags = cell.metadata.get("tags", [])
        if cell.cell_type != "code" or "remove-input" in tags:
            continue
        tree = ast.parse(cell.source)
        made = defined(tree)
        if "remove-cell" in tags:
            removed |= made
            continue
        shown |= made
        used = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
        lacking = used & (removed - shown)
        found += [
            f"cell {number}: uses {name!r}, which only a removed cell makes" for name in sorted(lacking)
        ]
    return found


def unknown_values(notebook: nbformat.NotebookNode) -> list[str]:
    """Return what the prose quotes and no cell has glued: the build would fail on it, after a quarter of an hour."""
    known, found = {"": dict(glued(notebook.cells))}, []
    for number, cell in enumerate(notebook.cells):
        for name in TRUTH.findall(cell.source) if cell.cell_type == "markdown" else ():
            if name not in known[""]:
                found.append(f"cell {number}: has a guess at {name!r}, which no cell glues")
        for role in ROLE.finditer(cell.source) if cell.cell_type == "markdown" else ():
            other, name, how = role[1] or "", role[2], role[3] or ""
            if other and role[3] is None:
                found.append(
                    f"cell {number}: quotes {name!r} of {other} without the colon that ends it: {name}:"
                )
            if other not in known:
                known[other] = dict(glued(nbformat.read(ROOT / "notebooks" / other, 4).cells))
            if name not in known[other]:
                said = f" of {other}" if other else ""
                found.append(f"cell {number}: quotes {name!r}, which no cell{said} glues")
            elif how and not is_number(known[other][name]):
                value = known[other][name]
                found.append(f"cell {number}: formats {name!r}, which is no plain number: {value[:40]}")
    return found


def is_number(text: str) -> bool:
    """Return whether a stored value can be formatted: the build reads it as text, and `np.float64(1.5)` is none."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    mode = parser.add_mutually_exclusive_group(required=True)
    mode.add_argument("--write", action="store_true")
    mode.add_argument("--check", action="store_true")
    parser.add_argument("notebooks", nargs="*", type=Path)
    args = parser.parse_args(arguments)

    failures = 0
    for path in args.notebooks or sorted((ROOT / "notebooks").glob("*.ipynb")):
        stored = path.read_text(encoding="utf8")
        notebook = strip(nbformat.reads(stored, as_version=4))
        stripped = text_of(notebook)
        if args.write and stripped != stored:
            store(path, stripped)
        problems = complaints(notebook)
        if args.check and stripped != stored:
            problems.append("stores pictures, HTML or volatile metadata: run `make format`")
        for problem in problems:
            print(f"{path.name}: {problem} (execute it with `make notebooks NB=notebooks/{path.name}`)")
        failures += len(problems)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
