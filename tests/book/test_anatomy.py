"""Core chapters and depth pages have their parts, in order; planted slips are noticed."""

from collections.abc import Callable
from pathlib import Path

import nbformat
import pytest

from tests.book import anatomy

NOTEBOOKS = anatomy.ROOT / "notebooks"
TEMPLATE = anatomy.ROOT / "tools" / "chapter_template.ipynb"


@pytest.mark.parametrize("name", anatomy.REWRITTEN)
def test_a_rewritten_chapter_has_its_parts(name: str) -> None:
    assert list(anatomy.core_lacks(NOTEBOOKS / f"{name}.ipynb")) == []


@pytest.mark.parametrize("name", anatomy.PAGES.depth)
def test_a_depth_page_hangs_together_with_its_chapter(name: str) -> None:
    assert list(anatomy.depth_lacks(NOTEBOOKS / f"{name}.ipynb")) == []


def test_every_notebook_is_on_one_page_of_the_book() -> None:
    """Front page, *Which policy?* and the live robot come first; whatever else is there is core or goes deeper."""
    assert set(anatomy.PAGES.core) & set(anatomy.PAGES.depth) == set()
    stored = {path.stem for path in NOTEBOOKS.glob("*.ipynb")}
    first = {"front_page", "which_policy", "live_robot"}
    assert {*anatomy.PAGES.core, *anatomy.PAGES.depth, *first} == stored


def changed(tmp_path: Path, change: Callable[[str], str]) -> Path:
    """The template with its prose changed, which must do something."""
    notebook, before = nbformat.read(TEMPLATE, as_version=4), anatomy.prose_of(TEMPLATE)
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            cell.source = change(cell.source)
    path = tmp_path / "chapter.ipynb"
    nbformat.write(notebook, path)
    assert anatomy.prose_of(path) != before
    return path


@pytest.mark.parametrize(
    ("written", "instead", "complaint"),
    [
        ("**Which question does the chapter answer?**", "A remark.", "a question in bold"),
        ("## What you will know", "## Objectives", "## What you will know"),
        ("- One more result", "One more result", "three lines"),
        ("dropdown teach", "dropdown", "dropdown teach"),
        ("planned minutes", "minutes", "'planned minutes'"),
        ("```{dropdown} Answer", "```{note} Answer", "an answer to Predict"),
        ("{guess}", "{note}", "takes a guess"),
        ("**(b)**", "(b)", "1 keys in the answer"),
        (" (5 min, easy)", "", "minutes and difficulty"),
        (" (5 min, easy)", " (5 min, trivial)", "minutes and difficulty"),
        ("## Summary", "## Conclusion", "## Summary"),
        ("## Pitfalls", "## Summary", "stands before"),
    ],
)
def test_a_missing_part_is_named(tmp_path: Path, written: str, instead: str, complaint: str) -> None:
    lacks = list(anatomy.core_lacks(changed(tmp_path, lambda text: text.replace(written, instead))))
    assert any(complaint in each for each in lacks), lacks


def test_a_definition_before_anything_is_shown_is_noticed(tmp_path: Path) -> None:
    early = "```{prf:definition} Early\n:label: def-early\n```\n\n## A hook"
    path = changed(tmp_path, lambda text: text.replace("## A hook", early))
    assert any("before the first definition" in each for each in anatomy.core_lacks(path))


@pytest.mark.parametrize(
    ("first", "complaint"),
    [
        ("# A page\n\nNo line.", "Going deeper, from"),
        ("# A page\n\n*Going deeper, from {doc}`errors`.*", "a core chapter to come from"),
        ("# A page\n\n*Going deeper, from {doc}`boundary_effect`.*", "a link from boundary_effect"),
    ],
)
def test_a_depth_page_that_nobody_reaches_is_noticed(tmp_path: Path, first: str, complaint: str) -> None:
    """The chapter is copied beside it, and does not know the page."""
    page = nbformat.v4.new_notebook(cells=[nbformat.v4.new_markdown_cell(f"{first}\n\n## Summary")])
    nbformat.write(page, tmp_path / "nobody_links_here.ipynb")
    (tmp_path / "boundary_effect.ipynb").write_bytes((NOTEBOOKS / "boundary_effect.ipynb").read_bytes())
    assert any(complaint in each for each in anatomy.depth_lacks(tmp_path / "nobody_links_here.ipynb"))
