"""Budgets of core chapters: what is counted, what is not, and that too much of anything fails the check."""

import json
import tomllib
from pathlib import Path
from typing import Any

import pytest

from inbounds.book.pages.counts import count, intervals
from tools import count_pages

ROOT = Path(__file__).resolve().parents[2]
BUDGETS = tomllib.loads((ROOT / "book" / "budgets.toml").read_text(encoding="utf8"))


def text(source: str) -> dict[str, Any]:
    return {"cell_type": "markdown", "source": source, "metadata": {}}


def code(source: str, *tags: str) -> dict[str, Any]:
    return {"cell_type": "code", "source": source, "metadata": {"tags": list(tags)}, "outputs": []}


def glued(name: str, value: str) -> dict[str, Any]:
    output = {"data": {"text/plain": value}, "metadata": {"scrapbook": {"name": name}}}
    return code("", "remove-cell") | {"outputs": [output]}


def test_the_rewritten_chapters_keep_to_their_budgets() -> None:
    assert list(count_pages.complaints(ROOT, BUDGETS)) == []


def test_the_budgets_name_chapters_of_the_book() -> None:
    core = count_pages.contents(ROOT / "_toc.yml").core
    assert {*BUDGETS["rewritten"], *BUDGETS["chapters"]} <= set(core)
    for group in BUDGETS["together"].values():
        there = [name for name in group["chapters"] if name in core]
        assert there == [name for name in core if name in group["chapters"]]


@pytest.mark.parametrize(
    ("prose", "words"),
    [
        ("one two-fold three", 3),
        ("a $x + y$ b", 3),
        ("a\n\n$$\nx = y + z\n$$ (eq-x)\n\nb", 3),
        ("see {doc}`the other page <other>` and {ref}`ex-1`", 6),
        ("it is {glue:text}`number:.2f` high", 4),
        ("[two words](https://somewhere.example/a/b)", 2),
        ("```{admonition} Note\n:class: tip\n\nthree more words\n```", 4),
        ("````{admonition} Predict\n:class: predict\n\n```{dropdown} Answer\nfold counts\n```\n````", 4),
        ("```python\nx = 1\n```", 0),
        ("(a-label)=\n# Title", 1),
        ("before\n\n```{admonition} Teach it\n:class: dropdown teach\n\n| a | b |\n```\n\nafter", 2),
        ("## Exercises\n\nno no no\n\n## Summary\n\nyes", 2),
        (
            "a\n\n```{exercise-start} Name (5 min, easy)\n:label: x\n```\n\nno\n\n```{exercise-end}\n```\n\nb",
            2,
        ),
    ],
)
def test_words(prose: str, words: int) -> None:
    assert count([text(prose)]).words == words


def test_a_solution_in_several_cells_does_not_count() -> None:
    cells = [
        text("one\n\n```{solution-start} ex\n:class: dropdown\n```\n\nno no"),
        code("no = 1"),
        text("no\n\n```{solution-end}\n```\n\ntwo"),
        code("yes = 1"),
    ]
    assert (count(cells).words, count(cells).lines) == (2, 1)


def test_visible_lines() -> None:
    cells = [
        code("a = 1\n\nb = 2"),
        code("hidden = 1", "hide-input"),
        code("gone = 1", "remove-cell"),
        text("```python\nimport x\n```\n\n````{note}\n```sh\ny\nz\n```\n````"),
        text("## Exercises"),
        code("stub = ..."),
        text("## Summary"),
        code("c = 3", "program"),
    ]
    assert count(cells).lines == 2 + 3 + 1


@pytest.mark.parametrize(
    ("paragraph", "how_many"),
    [
        ("{glue:text}`a` ({glue:text}`a-low` to {glue:text}`a-high`)", 1),
        ("from {glue:text}`a-low`\nto {glue:text}`a-high` and {glue:text}`b`", 1),
        ("between {glue:text}`a-low:.2f` and {glue:text}`a-high:.2f`", 1),
        ("{glue:text}`spoken`, {glue:text}`spoken`; {glue:text}`verdict`", 3),
        ("{glue:text}`one` and then something else, and {glue:text}`two`", 0),
        ("on $[-1, 1]$, from −1 to 1", 0),
    ],
)
def test_intervals(paragraph: str, how_many: int) -> None:
    texts = {"spoken": "'407 [−21, 871]'", "verdict": "(effects between −12.5 and 3 points remain possible)"}
    assert intervals(paragraph, texts) == how_many


def test_the_fullest_paragraph_counts_and_a_table_does_not() -> None:
    pair = "{glue:text}`spoken`"
    cells = [
        text(f"{pair}, {pair}\n\n- {pair}\n- {pair}\n- {pair}\n\n| a | {pair} {pair} {pair} |"),
        glued("spoken", "'1 [0, 2]'"),
    ]
    assert count(cells).intervals == 2


def book(folder: Path, **chapters: list[dict[str, Any]]) -> Path:
    """A book of core chapters."""
    (folder / "notebooks").mkdir()
    for name, cells in chapters.items():
        (folder / "notebooks" / f"{name}.ipynb").write_text(json.dumps({"cells": cells}))
    files = ", ".join(f"{{file: notebooks/{name}}}" for name in chapters)
    (folder / "_toc.yml").write_text(f"root: a\nparts: [{{numbered: 2, chapters: [{files}]}}]")
    return folder


SMALL = {
    "rewritten": ["a"],
    "core": {"words": 5, "lines": 2, "statements": 1, "intervals": 1, "check": 2},
    "chapters": {"b": {"lines": 3}},
    "together": {"Part I": {"words": 8, "chapters": ["a", "b"]}},
}
ONE = "{glue:text}`low` to {glue:text}`high`"


@pytest.mark.parametrize(
    ("cells", "complaint"),
    [
        ([text("one two three four five six")], "a: 6 words, 1 more than 5: move what"),
        ([code("x = 1\ny = 2\nz = 3")], "a: 3 lines, 1 more than 2: move a program"),
        ([text("```{prf:lemma} A\n```\n\n```{prf:theorem} B\n```")], "a: 2 statements, 1 more than 1"),
        ([text(f"{ONE}, {ONE}")], "more than 1: put them into a table"),
        ([code("x = 1", "program", "hide-input")], "cell 0 is part of the program and hidden"),
        (
            [text("**Check it.** Now."), code("assert x", "hide-input")],
            "cell 1 checks a statement and is hidden",
        ),
        ([text("**Check it.**"), code("x = 1\ny = 2\nz = 3")], "cell 1 checks in 3 lines, 1 more than 2"),
    ],
)
def test_too_much_fails(tmp_path: Path, cells: list[dict[str, Any]], complaint: str) -> None:
    found = list(count_pages.complaints(book(tmp_path, a=cells), SMALL))
    assert any(complaint in each for each in found), found
    assert list(count_pages.complaints(tmp_path, SMALL | {"rewritten": []})) == []


def test_a_program_chapter_has_a_budget_of_its_own(tmp_path: Path) -> None:
    cells = [code("x = 1\ny = 2\nz = 3")]
    root = book(tmp_path, a=[text("one")], b=cells)
    assert list(count_pages.complaints(root, SMALL | {"rewritten": ["a", "b"]})) == []
    assert len(list(count_pages.complaints(root, SMALL | {"rewritten": ["b"], "chapters": {}}))) == 1


def test_the_sum_counts_once_all_are_rewritten(tmp_path: Path) -> None:
    root = book(tmp_path, a=[text("one two three four five")], b=[text("one two three four")])
    assert list(count_pages.complaints(root, SMALL)) == []
    (found,) = count_pages.complaints(root, SMALL | {"rewritten": ["a", "b"]})
    assert found.startswith("Part I: 9 words together, 1 more than 8")


def test_a_name_that_no_chapter_has_is_noticed(tmp_path: Path) -> None:
    (found,) = count_pages.complaints(book(tmp_path, b=[]), SMALL)
    assert "no core chapter" in found
