"""A chapter's own program: the imports that its prose prints, and the cells that it calls its own."""

from pathlib import Path
from typing import Any

import nbformat

NOTEBOOKS = Path(__file__).resolve().parents[2] / "notebooks"


def program_text(chapter: str, tag: str, first_import: str) -> str:
    """Return the program of a chapter.

    Args:
        chapter: name of the notebook, without its ending.
        tag: of the cells that belong to it.
        first_import: first module that the printed imports name.
    """
    cells = nbformat.read(NOTEBOOKS / f"{chapter}.ipynb", as_version=4).cells
    fence = "```python\n"
    (prose,) = (
        c.source for c in cells if c.cell_type == "markdown" and f"{fence}import {first_import}" in c.source
    )
    imports = prose.partition(fence)[2].partition("```")[0]
    own = [c.source for c in cells if tag in c.metadata.get("tags", [])]
    return "\n\n".join([imports, *own])


def run(text: str) -> dict[str, Any]:
    """Run a program, and return the names that it leaves."""
    namespace: dict[str, Any] = {}
    exec(compile(text, "the chapter", "exec"), namespace)
    return namespace
