"""The plans of *Teach it*: the minutes add up, and an exercise gets at least the minutes of its title."""

import re
import tomllib
from pathlib import Path

import pytest

from inbounds.book.pages.plans import COURSE, plan_of
from tests.book import anatomy

ROOT = Path(__file__).resolve().parents[2]
BUDGETS = tomllib.loads((ROOT / "book" / "budgets.toml").read_text(encoding="utf8"))
CHAPTERS = [name for part in BUDGETS["together"] for name in BUDGETS["together"][part]["chapters"]]
TITLE = re.compile(r"\{exercise-start\}[^\n]*\((\d+) min, \w+\)\s*\n:label: (\S+)")


def of(chapter: str) -> Path:
    return ROOT / "notebooks" / f"{chapter}.ipynb"


@pytest.mark.parametrize("chapter", CHAPTERS)
def test_the_minutes_add_up(chapter: str) -> None:
    plan = plan_of(of(chapter))
    cells = [cell for step in plan.steps for cell in (step.short, step.long)]
    assert [cell for cell in cells if not re.fullmatch(r"\d+( \(begin\))?|at home|–", cell)] == []
    assert (plan.minutes("short"), plan.minutes("long")) == (50, 90)


def test_every_session_of_a_course_is_held_to_it() -> None:
    assert set(COURSE) <= set(CHAPTERS)


@pytest.mark.parametrize("chapter", CHAPTERS)
def test_an_exercise_gets_its_minutes(chapter: str) -> None:
    need = {label: int(number) for number, label in TITLE.findall(anatomy.prose_of(of(chapter)))}
    planned = {
        label: (step.text, step.minutes("long"))
        for step in plan_of(of(chapter)).steps
        for label in re.findall(r"\{ref\}`(ex-[\w-]+)`", step.text)
        if step.minutes("long")
    }
    assert planned  # no plan of 90 minutes without an exercise
    too_short = {label: step for label, (step, long) in planned.items() if long < need[label]}
    assert too_short == {}
