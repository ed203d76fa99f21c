"""Values that a notebook glues, and the roles by which prose shows them, of this notebook or of another."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import Any

ROLE = re.compile(r"\{glue:?\w*\}`(?:([^`:]+\.ipynb)::)?([^`:]+)(?::([^`]*))?`")
"""Three groups: the notebook, where it is another one; the name; the format, if a colon stands before it."""


def glued(cells: Sequence[dict[str, Any]]) -> Iterator[tuple[str, str]]:
    """Yield the name of each value that cells glue, and the value as their outputs keep it, its `repr`.

    Args:
        cells: of a notebook, with their outputs.

    Example:
        >>> kept = {"metadata": {"scrapbook": {"name": "width"}}, "data": {"text/plain": "0.4"}}
        >>> dict(glued([{"outputs": [kept]}]))
        {'width': '0.4'}
    """
    for output in (output for cell in cells for output in cell.get("outputs", ())):
        if name := output.get("metadata", {}).get("scrapbook", {}).get("name"):
            plain = (text for kind, text in output["data"].items() if kind.endswith("text/plain"))
            yield name, "".join(next(plain, ""))
