"""Core chapters and the pages of *Going deeper*, as the table of contents has them.

A **core chapter** is a notebook in a numbered part of ``_toc.yml``; a **depth page** a notebook in the part captioned
*Going deeper*. Whatever else is there (front page, preface, reference) is neither.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import yaml

DEPTH_CAPTION = "Going deeper"
"""The caption of the part that holds the depth pages."""


@dataclass(frozen=True)
class Contents:
    """The notebooks of a book, by kind.

    Example:
        >>> Contents(core=("beta_policies",), depth=("grids",)).kind("grids")
        'depth'
    """

    core: tuple[str, ...]
    """Names of the core chapters without their ending, in the book's order."""
    depth: tuple[str, ...]
    """Names of the depth pages, in the book's order."""

    def kind(self, name: str) -> str:
        """Return ``core``, ``depth`` or, for every other page, an empty string."""
        return "core" if name in self.core else "depth" if name in self.depth else ""


def contents(toc: Path) -> Contents:
    r"""Read a table of contents.

    Args:
        toc: a book's ``_toc.yml``, at its root.

    Example:
        >>> from pathlib import Path
        >>> from tempfile import TemporaryDirectory
        >>> with TemporaryDirectory() as folder:
        ...     toc = Path(folder, "_toc.yml")
        ...     _ = toc.write_text("root: a\nparts: [{numbered: 2, chapters: [{file: notebooks/b}]}]")
        ...     contents(toc)
        Contents(core=('b',), depth=())
    """
    parts = yaml.safe_load(toc.read_text(encoding="utf8")).get("parts", [])
    core = [part for part in parts if part.get("numbered")]
    depth = [part for part in parts if part.get("caption") == DEPTH_CAPTION]
    return Contents(*(tuple(_notebooks(found)) for found in (core, depth)))


def _notebooks(parts: list[dict]) -> list[str]:
    files = [Path(chapter["file"]) for part in parts for chapter in part["chapters"]]
    return [file.name for file in files if file.parent.name == "notebooks"]
