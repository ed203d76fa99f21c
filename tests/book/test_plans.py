"""The plans of *Teach it*: the minutes add up, and an exercise gets at least the minutes of its title."""

import json
import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
BUDGETS = tomllib.loads((ROOT / "book" / "budgets.toml").read_text(encoding="utf8"))
CHAPTERS = [name for part in BUDGETS["together"] for name in BUDGETS["together"][part]["chapters"]]
TITLE = re.compile(r"\{exercise-start\}[^\n]*\((\d+) min, \w+\)\s*\n:label: (\S+)")


def prose(chapter: str) -> str:
    notebook = json.loads((ROOT / "notebooks" / f"{chapter}.ipynb").read_text(encoding="utf8"))
    return "\n".join("".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "markdown")


def plan(text: str) -> list[tuple[str, int | None, int | None]]:
    """Steps with the minutes of the short and of the long session; None where it is not in class, or only begun."""
    fold = text[
        text.index("{admonition} Teach it") : text.index("\n## ", text.index("{admonition} Teach it"))
    ]
    rows = [row.strip("|").split("|") for row in fold.splitlines() if row.startswith("|")][2:]
    return [(step, minutes(short), minutes(long)) for step, short, long in rows]


def minutes(cell: str) -> int | None:
    found = re.fullmatch(r"\s*(\d+)( \(begin\))?\s*", cell)
    return int(found[1]) if found else None


@pytest.mark.parametrize("chapter", CHAPTERS)
def test_the_minutes_add_up(chapter: str) -> None:
    steps = plan(prose(chapter))
    assert sum(short or 0 for _, short, _ in steps) == 50
    assert sum(long or 0 for _, _, long in steps) == 90


@pytest.mark.parametrize("chapter", CHAPTERS)
def test_an_exercise_gets_its_minutes(chapter: str) -> None:
    text = prose(chapter)
    need = {label: int(number) for number, label in TITLE.findall(text)}
    planned = {
        label: (step, long)
        for step, _, long in plan(text)
        for label in re.findall(r"\{ref\}`(ex-[\w-]+)`", step)
        if long is not None
    }
    assert planned  # no plan of 90 minutes without an exercise
    too_short = {label: step for label, (step, long) in planned.items() if long < need[label]}
    assert too_short == {}
