"""The courses of the page for lecturers come from the chapters, and their minutes add up."""

import json
import re
from pathlib import Path

import pytest

from inbounds.book.pages.plans import COURSE, course, plan_of, sessions
from tests.book import anatomy

ROOT = Path(__file__).resolve().parents[2]
NOTEBOOKS = ROOT / "notebooks"
PAGE = (ROOT / "book" / "teaching.md").read_text(encoding="utf8")


def test_the_courses_follow_the_book() -> None:
    places = [anatomy.PAGES.core.index(chapter) for chapter in COURSE]
    assert places == sorted(places)
    for count in (4, 8):
        assert len(sessions(count)) == count
        assert tuple(chapter for chapters in sessions(count) for chapter in chapters) == COURSE


@pytest.mark.parametrize(("count", "minutes"), [(4, 100), (8, 90)])
def test_what_is_shown_adds_up(count: int, minutes: int) -> None:
    """The rows that a reader sees, summed again from the Markdown."""
    text = "\n".join(course(count, NOTEBOOKS))
    shown = re.split(r"^\*\*Session ", text, flags=re.M)[1:]
    assert len(shown) == count
    for session in shown:
        rows = re.findall(r"^\| (\d+)(?: \(begin\))? \|", session, re.M)
        assert sum(map(int, rows)) == minutes
        announced = re.search(r"\*\*, ([\d +]+) planned minutes", session)
        assert announced
        assert sum(map(int, announced[1].split("+"))) == minutes
        chapters = re.findall(r"\{doc\}`\.\./notebooks/(\w+)`", session.partition("\n")[0])
        decks = re.findall(r"`(\w+)\.html`", session.partition("\n")[0])
        assert decks == chapters  # `tools/slides.py` names a deck like its chapter
    assert "| – |" not in text
    assert "{glue" not in text  # a number of another page's notebook would not be found
    for target in re.findall(r"\{doc\}`(?:[^`<]*<)?([^`>]+)>?`", text):
        assert (ROOT / "book" / f"{target}.ipynb").resolve().is_file(), target


def test_the_page_has_both_courses_and_nothing_typed() -> None:
    assert re.findall(r"^```\{course\} (\d)$", PAGE, re.M) == ["8", "4"]
    assert "## Eight sessions of 90 minutes" in PAGE
    for command in (
        "tools/student_copies.py lab",
        "inbounds grade handed-in --out grades.csv",
        "inbounds doctor",
    ):
        assert command in PAGE
    assert "`make slides` writes them into `_build/slides`" in PAGE
    for name in re.findall(r"`(build_\w+)\.ipynb`", PAGE):
        assert (ROOT / "tools" / "build" / f"{name.removeprefix('build_')}.ipynb").is_file()


def test_a_chapter_without_a_plan_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "chapter.ipynb"
    path.write_text(json.dumps({"cells": [{"cell_type": "markdown", "source": ["# A chapter"]}]}))
    with pytest.raises(ValueError, match="no \\*Teach it\\*"):
        plan_of(path)
    with pytest.raises(ValueError, match="choose 4 or 8"):
        sessions(5)
