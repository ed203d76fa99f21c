"""What the download button of a chapter hands out."""

import re

import nbformat
import pytest

from tests.pages import browser as book

CHAPTERS = [name for name in book.pages() if name.startswith("notebooks/")]


@pytest.mark.parametrize("name", CHAPTERS)
def test_the_button_hands_out_a_notebook_without_solutions(name: str) -> None:
    page = book.HTML / name
    links = set(re.findall(r'href="([^"]*_sources/[^"]*\.ipynb)"', page.read_text(encoding="utf-8")))
    assert len(links) == 1
    notebook = nbformat.read((page.parent / links.pop()).resolve(), as_version=4)
    assert notebook.cells[0].source.startswith("# ")
    assert not any("solution" in cell.metadata.get("tags", []) for cell in notebook.cells)
    assert not any("{solution-start}" in cell.source for cell in notebook.cells)
    assert not any(cell.get("outputs") for cell in notebook.cells)
