"""The cells of a stored notebook, and what its metadata says, without loading Jupyter."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any


def read_cells(path: Path) -> list[dict[str, Any]]:
    """Return the cells of a notebook, each with its source as one text."""
    cells = json.loads(path.read_text(encoding="utf8"))["cells"]
    return [cell | {"source": "".join(cell["source"])} for cell in cells]


def read_metadata(path: Path) -> dict[str, Any]:
    """Return the metadata of a notebook."""
    return json.loads(path.read_text(encoding="utf8")).get("metadata", {})
