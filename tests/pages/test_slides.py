"""Slides: each has room for what it says, and a picture fills it, on a projector and on paper."""

import importlib
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser

from inbounds.book.pages.contents import contents
from tests.pages import browser as books

ROOT = Path(__file__).resolve().parents[2]
CHAPTERS = contents(ROOT / "_toc.yml").core
PROJECTOR = {"width": 1280, "height": 720}
PAPER = {"width": 1122, "height": 631}  # 297 mm by 167 mm, at 96 dots an inch
CROWDED = """() => slides.filter((slide) => {
  location.hash = slide.id;
  show();
  const said = slide.querySelector('.said');
  return slide.scrollHeight > innerHeight + 1 || said.scrollHeight > said.clientHeight + 1
    || document.documentElement.scrollWidth > innerWidth;
}).map((slide) => slide.innerText.slice(0, 60))"""
CUT = """() => slides.filter((slide) => slide.scrollHeight > slide.clientHeight + 1)
  .map((slide) => slide.innerText.slice(0, 60))"""
SMALL = """() => slides.filter((slide) => slide.querySelector('.said > img')).filter((slide) => {
  location.hash = slide.id;
  show();
  return slide.querySelector('.said > img').getBoundingClientRect().height < innerHeight / 3;
}).map((slide) => slide.innerText.slice(0, 60))"""


@pytest.fixture(scope="module")
def tool() -> Iterator[object]:
    sys.path.insert(0, str(ROOT / "tools"))
    try:
        yield importlib.import_module("slides")
    finally:
        sys.path.remove(str(ROOT / "tools"))


@pytest.mark.parametrize("name", CHAPTERS)
def test_every_slide_has_room(tool: object, name: str, browser: Browser, tmp_path: Path) -> None:
    tool.formulas_for(books.HTML, tmp_path)
    count = tool.deck(books.HTML, name, tmp_path)
    page = browser.new_page(viewport=PROJECTOR)
    try:
        page.goto((tmp_path / f"{name}.html").as_uri())
        page.evaluate("document.fonts.ready")
        assert page.evaluate("slides.length") == count
        assert page.evaluate(CROWDED) == []
        assert page.evaluate(SMALL) == []
        page.emulate_media(media="print")
        page.set_viewport_size(PAPER)
        assert page.evaluate(CUT) == []
    finally:
        page.close()
