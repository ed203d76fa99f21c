"""Which exercises `inbounds grade` judges: those below which a notebook calls one of its chapter's graders."""

from __future__ import annotations

import re
from pathlib import Path

from inbounds.book.pages.cells import read_cells

_CALL = re.compile(r"\bgraders\.(\w+)\(")
_SHOWN = re.compile(r"^(?:graders|advantages_of_actions|many_steps_from_one_batch)\.(\w+)\(", re.M)
"""The notebooks with blanks call the graders of two earlier chapters by their modules' names."""
_START = re.compile(r"^(?:`{3,}|:{3,})\{exercise-start\}.*\n(?::(?!label)\w+:.*\n)*:label:[ \t]*(\S+)", re.M)


def graders_in(source: str) -> list[str]:
    """Return the names of the graders that some code calls, in order.

    Example:
        >>> graders_in("graders.loss(my_loss), graders.update(my_update)")
        ['loss', 'update']
    """
    return _CALL.findall(source)


def grader_shown(source: str) -> str | None:
    r"""Return the grader whose judgement a cell shows: the last one that is called at the beginning of a line.

    Example:
        >>> grader_shown("print(graders.loss(wrong).message)\ngraders.update(my_update)")
        'update'
        >>> grader_shown("print(graders.loss(wrong).message)") is None
        True
    """
    found = _SHOWN.findall(source)
    return found[-1] if found else None


def graders_of(notebook: Path) -> dict[str, list[str]]:
    """Return the exercises of a notebook by label, each with the graders called between it and the next.

    Example:
        >>> from inbounds.study.store import ROOT
        >>> found = graders_of(ROOT / "notebooks" / "ppo.ipynb")  # in the project's folder
        >>> found["ex-10-implement"], found["ex-10-warmup"]
        (['loss', 'update'], [])
    """
    found: dict[str, list[str]] = {}
    label = ""
    for cell in read_cells(notebook):
        if cell["cell_type"] == "markdown":
            for label in _START.findall(cell["source"]):
                found[label] = []
        elif label:
            found[label] += graders_in(cell["source"])
    return found
