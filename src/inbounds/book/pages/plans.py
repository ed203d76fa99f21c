"""The lecturer's plans, as the folds *Teach it* of the chapters have them, and two courses made of them.

The page for lecturers (`book/teaching.md`) shows what is read here at build, so that it says what the chapters say.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from inbounds.book.pages.cells import read_cells

COURSE = (
    "actions_have_bounds",
    "policy_that_learns",
    "boundary_effect",
    "logit_normal_density",
    "kl_invariance",
    "many_steps_from_one_batch",
    "ppo",
    "what_happened",
)
"""The chapters of both courses, in the book's order: eight sessions of 90 minutes, or four of twice 50."""
Length = Literal["short", "long"]
_FOLD = re.compile(r"^(`{3,}|:{3,})\{admonition\} Teach it\n(.*?)^\1[ \t]*$", re.M | re.S)
_DOC = re.compile(r"\{doc\}`(?:([^`<]*)<)?([\w-]+)(>?)`")


@dataclass(frozen=True)
class Step:
    """A row of a plan.

    Example:
        >>> Step("the films", "5", "at home").minutes("short"), Step("the films", "5", "at home").minutes("long")
        (5, 0)
    """

    text: str
    """What is done, MyST Markdown."""
    short: str
    """Minutes in a session of 50, or words: not in class."""
    long: str
    """The same in a session of 90."""

    def minutes(self, length: Length) -> int:
        """Return the planned minutes in a session, 0 where the step is not in class."""
        found = re.match(r"\d+", _minutes_of(self, length))
        return int(found[0]) if found else 0


@dataclass(frozen=True)
class Plan:
    """A chapter's *Teach it*.

    Made by `plan_of`.
    """

    chapter: str
    """The notebook's name, without its ending."""
    steps: tuple[Step, ...]
    """In order."""
    remark: str
    """What the fold says beside its table, MyST Markdown."""

    def minutes(self, length: Length) -> int:
        """Return the planned minutes of a session."""
        return sum(step.minutes(length) for step in self.steps)


def plan_of(notebook: Path) -> Plan:
    """Read the plan of a chapter.

    Args:
        notebook: the chapter's file.

    Raises:
        ValueError: the chapter has no fold *Teach it*, or no table in it.

    Example:
        >>> from inbounds.study.store import ROOT
        >>> plan = plan_of(ROOT / "notebooks" / "ppo.ipynb")  # in the project's folder
        >>> plan.minutes("short"), plan.minutes("long")
        (50, 90)
    """
    prose = "\n\n".join(cell["source"] for cell in read_cells(notebook) if cell["cell_type"] == "markdown")
    fold = _FOLD.search(prose)
    lines = fold[2].splitlines() if fold else []
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if line.startswith("|")]
    if len(rows) < 3 or any(len(row) != 3 for row in rows):
        raise ValueError(f"{notebook.name} has no *Teach it* with a table of three columns: step, 50, 90")
    rest = [line for line in lines if not line.startswith(("|", ":"))]
    remark = "\n".join(line for line in rest if "planned minutes*" not in line).strip()
    return Plan(notebook.stem, tuple(Step(*row) for row in rows[2:]), remark)


def sessions(count: int) -> tuple[tuple[str, ...], ...]:
    """Return the chapters of each session of a course.

    Args:
        count: 4, each session two short plans with a break between them, or 8, each one long plan.

    Raises:
        ValueError: there is no course of so many sessions.

    Example:
        >>> sessions(4)[0]
        ('actions_have_bounds', 'policy_that_learns')
    """
    if count not in (4, 8):
        raise ValueError(f"there is no course of {count} sessions: choose 4 or 8")
    each = len(COURSE) // count
    return tuple(COURSE[i : i + each] for i in range(0, len(COURSE), each))


def course(count: int, notebooks: Path) -> Iterator[str]:
    """Yield a course as lines of MyST Markdown, for a page in a folder beside the notebooks'.

    Args:
        count: of sessions, 4 or 8.
        notebooks: the folder of the chapters.

    Example:
        >>> from inbounds.study.store import ROOT
        >>> lines = list(course(8, ROOT / "notebooks"))  # in the project's folder
        >>> lines[0].partition(" (")[0]
        '**Session 1**, 90 planned minutes: {doc}`../notebooks/actions_have_bounds`'
    """
    length: Length = "short" if count == 4 else "long"
    for number, chapters in enumerate(sessions(count), 1):
        plans = [plan_of(notebooks / f"{chapter}.ipynb") for chapter in chapters]
        total = " + ".join(str(plan.minutes(length)) for plan in plans)
        names = ", then ".join(f"{{doc}}`../notebooks/{plan.chapter}`" for plan in plans)
        decks = ", ".join(f"`{plan.chapter}.html`" for plan in plans)
        yield from (f"**Session {number}**, {total} planned minutes: {names} (slides: {decks})", "")
        yield from ("::::{dropdown} Its steps", "")
        for plan in plans:
            yield from (f"{{doc}}`../notebooks/{plan.chapter}`", "", "| Minutes | Step |", "|---|---|")
            yield from (
                f"| {_minutes_of(step, length)} | {_from_beside(step.text)} |"
                for step in plan.steps
                if _minutes_of(step, length) != "–"
            )
            yield from ("", _from_beside(plan.remark), "")
        yield from ("::::", "")


def _minutes_of(step: Step, length: Length) -> str:
    return step.short if length == "short" else step.long


def _from_beside(text: str) -> str:
    """Let links to chapters start from the folder beside theirs."""
    return _DOC.sub(lambda m: f"{{doc}}`{m[1] + '<' if m[1] else ''}../notebooks/{m[2]}{m[3]}`", text)
