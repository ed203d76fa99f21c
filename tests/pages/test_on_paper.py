"""Printed: pages with numbers, an outline, tags and links that lead somewhere; nothing larger than the paper."""

import importlib
import sys
from pathlib import Path

import pytest
from playwright.sync_api import Browser
from pypdf import PdfReader

from tests.pages import browser as books

pytestmark = pytest.mark.pages
ROOT = Path(__file__).resolve().parents[2]
NAMES = ["notebooks/front_page", "notebooks/trpo", "notebooks/claim_by_claim"]
TOO_WIDE = """() => {
  const room = document.querySelector('main').getBoundingClientRect().right + 2;
  const seen = [...document.querySelectorAll('main :is(table, pre, img, mjx-container, figure)')];
  return seen.filter((it) => it.checkVisibility() && it.getBoundingClientRect().right > room)
    .map((it) => `${it.tagName} ${(it.alt || it.textContent || '').trim().slice(0, 60)}`);
}"""

TOO_LONG = """() => [...document.querySelectorAll('main img')]
  .filter((it) => it.getBoundingClientRect().height > 900).map((it) => it.alt.slice(0, 60))"""


@pytest.fixture(scope="module")
def tool() -> object:
    sys.path.insert(0, str(ROOT / "tools"))
    try:
        yield importlib.import_module("print_book")
    finally:
        sys.path.remove(str(ROOT / "tools"))


def test_a_print_has_numbers_an_outline_and_tags(tool: object, tmp_path: Path, browser: Browser) -> None:
    out = tmp_path / "three.pdf"
    first = tool.print_book(books.HTML, NAMES, out, browser=browser)
    reader = PdfReader(out)
    assert list(first) == NAMES
    assert list(first.values()) == sorted(set(first.values()))
    assert reader.trailer["/Root"]["/MarkInfo"]["/Marked"]
    assert "/StructTreeRoot" in reader.trailer["/Root"]
    titles = [each.title for each in reader.outline if not isinstance(each, list)]
    assert any("TRPO" in title for title in titles)
    texts = [page.extract_text() for page in reader.pages]
    assert [text for text in texts[1:] if len(text.split()) < 6] == []  # a title, its block on the next page
    contents = texts[1]
    for name, number in first.items():
        assert str(number) in contents
        assert str(number) in texts[number - 1], name
    assert not (books.HTML / "notebooks" / "whole-book-for-print.htm").exists()


@pytest.mark.parametrize("name", [*NAMES, "notebooks/bang_bang"])  # the last one has the longest picture
def test_nothing_is_wider_than_the_paper_and_no_picture_longer(
    tool: object, name: str, browser: Browser, tmp_path: Path
) -> None:
    document = books.HTML / "notebooks" / f"print-of-{name.rpartition('/')[2]}.htm"
    document.write_text(tool.one_document.join(books.HTML, [name], {}), encoding="utf8")
    try:
        page = browser.new_page(viewport=tool.PAPER)
        page.emulate_media(media="print")
        page.goto(document.as_uri())
        page.evaluate(tool.SETTLED)
        page.evaluate(tool.FIT)
        assert page.evaluate(TOO_WIDE) == []
        assert page.evaluate(TOO_LONG) == []
        page.close()
    finally:
        document.unlink()
