"""The program of a chapter as one file: its tagged cells, in order, and a command line.

Nothing of a program stands twice: the page shows the cells, and the file, its listing and its download are assembled
from them. The file runs without this package (``python policy_that_learns.py --policy gaussian``).
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from inbounds.book.pages.counts import read_cells

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


def assemble(notebook: Path) -> str:
    """Return a chapter's program as the text of one file.

    Args:
        notebook: the chapter.

    Raises:
        ValueError: no cell of it is tagged as part of a program.
    """
    cells = read_cells(notebook)
    sources = program_cells(cells)
    if not sources:
        raise ValueError(f"{notebook.name} has no program: tag its cells with {TAG!r}")
    title = cells[0]["source"].partition("\n")[0].removeprefix("# ")
    opening = f'"""{title}: the program of this chapter of In Bounds, explained there.\n\nMIT licence.\n"""'
    return "\n\n\n".join([opening, *sources, COMMAND_LINE.strip("\n")]) + "\n"


def has_program(notebook: Path) -> bool:
    """Say whether a notebook has a program."""
    return bool(program_cells(read_cells(notebook)))
