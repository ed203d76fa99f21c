"""The program of a chapter as one file: its tagged cells, in order, and a command line.

Nothing of a program stands twice: the page shows the cells, and the file, its listing and its download are assembled
from them. The file runs without this package (``python policy_that_learns.py --policy gaussian``).

A chapter may continue another's program: its cells replace blocks and add some (`inbounds.book.pages.blocks`).
"""

from __future__ import annotations

import linecache
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from inbounds.book.pages.blocks import ANCHOR, Program, difference, grown, text_of, without
from inbounds.book.pages.cells import read_cells, read_metadata

NOTEBOOKS = Path(__file__).resolve().parents[4] / "notebooks"  # src/inbounds/book/pages/programs.py
KEY = "program"
"""Of a notebook's metadata: which program it continues, and what it drops of it."""

TAG = "program"
"""Of the cells that make up a chapter's program."""
EXTENSION_TAG = "program-extension"
"""Beside `TAG`, of cells that extend a program which is complete before them."""
COMMAND_LINE = """
if __name__ == "__main__":
    import argparse

    parser = argparse.ArgumentParser()
    parser.add_argument("--env", default="InvertedPendulum-v5")
    parser.add_argument("--policy", default=next(iter(POLICIES)), choices=POLICIES)
    parser.add_argument("--epochs", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    options.policy = POLICIES[options.policy]
    train(**vars(options))
"""
"""What every program ends with: `train(env, policy, epochs, seed)` and `POLICIES` are its contract."""


def program_cells(cells: Sequence[dict[str, Any]], extensions: bool = True) -> list[str]:
    """Return the sources of the cells that make up a program.

    Args:
        cells: of a notebook, as `read_cells` returns them.
        extensions: with the cells that extend it.

    Example:
        >>> cells = [{"source": "x = 1", "metadata": {"tags": ["program"]}}, {"source": "x", "metadata": {}}]
        >>> program_cells(cells)
        ['x = 1']
    """
    tags = [set(cell.get("metadata", {}).get("tags", [])) for cell in cells]
    return [
        cell["source"].strip("\n")
        for cell, own in zip(cells, tags, strict=True)
        if TAG in own and (extensions or EXTENSION_TAG not in own)
    ]


def program_of(notebook: Path) -> Program:
    """Return a chapter's program: that of the chapter which it continues, changed by its own cells.

    Args:
        notebook: the chapter. Its metadata may say ``"program": {"continues": NAME, "drops": [BLOCK, ...]}``.

    Raises:
        ValueError: no cell of it is tagged as part of a program, or it drops what is not there.
    """
    sources = program_cells(read_cells(notebook))
    if not sources:
        raise ValueError(f"{notebook.name} has no program: tag its cells with {TAG!r}")
    program, anchor = before(notebook), ANCHOR if continued(notebook) else ""
    for source in sources:
        program = grown(program, source, anchor)
    return without(program, read_metadata(notebook).get(KEY, {}).get("drops", []))


def continued(notebook: Path) -> Path | None:
    """Return the chapter whose program a chapter continues."""
    name = read_metadata(notebook).get(KEY, {}).get("continues")
    return notebook.with_name(f"{name}.ipynb") if name else None


def before(notebook: Path) -> Program:
    """Return the program with which a chapter begins: empty where it continues none."""
    earlier = continued(notebook)
    return program_of(earlier) if earlier else Program()


def assemble(notebook: Path) -> str:
    """Return a chapter's program as the text of one file.

    Args:
        notebook: the chapter.

    Raises:
        ValueError: no cell of it is tagged as part of a program.
    """
    body = text_of(program_of(notebook))
    title = read_cells(notebook)[0]["source"].partition("\n")[0].removeprefix("# ")
    opening = f'"""{title}: the program of this chapter of In Bounds, explained there.\n\nMIT licence.\n"""'
    return f"{opening}\n\n{body}\n\n\n{COMMAND_LINE.strip()}\n"


def diff(notebook: Path) -> str:
    """Return what a chapter changes in the program that it continues, block by block.

    Args:
        notebook: the chapter.

    Raises:
        ValueError: it has no program, or continues none.
    """
    if continued(notebook) is None:
        raise ValueError(f"{notebook.name} continues no program: name one in its metadata")
    return difference(before(notebook), program_of(notebook))


def start(namespace: dict[str, Any], chapter: str, notebooks: Path = NOTEBOOKS) -> None:
    """Put a chapter's program into a namespace, so that what is defined there anew is what the others call.

    Args:
        namespace: ``globals()`` of a notebook.
        chapter: name of the notebook whose program it is, without its ending.
        notebooks: folder of the chapters.

    Raises:
        FileNotFoundError: the package is not installed from the book's folder, or has no chapter of that name.
    """
    text, file = text_of(program_of(notebooks / f"{chapter}.ipynb")), f"<the program of {chapter}>"
    linecache.cache[file] = len(text), None, text.splitlines(keepends=True), file  # for tracebacks
    exec(compile(text, file, "exec"), namespace)


def has_program(notebook: Path) -> bool:
    """Say whether a notebook has a program."""
    return bool(program_cells(read_cells(notebook)))
