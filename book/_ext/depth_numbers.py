"""What stands on a page without a number is counted with a D: *Theorem D.7* is no theorem of chapter 7.

Sphinx numbers statements, exercises and equations by chapter, 3.1, where the chapter has a number, and through all
other pages by a bare 1, 2, 3. Read in a chapter, a bare number seems to be one of that chapter.
"""

from collections.abc import Callable
from typing import Any

from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment

DEPTH = "D"  # of "depth": the pages of *Going deeper*


def renumber(env: BuildEnvironment, change: Callable[[tuple[Any, ...]], tuple[Any, ...]]) -> None:
    """Change all numbers that Sphinx has given."""
    for kinds in env.toc_fignumbers.values():
        for numbers in kinds.values():
            numbers.update({key: change(number) for key, number in numbers.items()})


def mark(app: Sphinx, env: BuildEnvironment) -> list[str]:
    """Put the letter before each number that has no chapter's."""
    renumber(env, lambda number: (DEPTH, *number) if len(number) == 1 else number)
    return []


def unmark(app: Sphinx, env: BuildEnvironment, *changes: set[str]) -> list[str]:
    """Take it away from what an earlier build stored, as Sphinx compares old numbers with new ones."""
    renumber(env, lambda number: number[1:] if number[0] == DEPTH else number)
    return []


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the handlers (called by Sphinx)."""
    app.connect("env-get-outdated", unmark)
    app.connect("env-get-updated", mark, priority=900)  # when Sphinx has counted
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
