"""The built book at 360 pixels: six robots stand in one column, and no punctuation stands on a line alone."""

import pytest
from playwright.sync_api import Page

from tests.pages import browser as book

# Lines of the text that hold nothing but closing punctuation.
LONELY = r"""() => {
  const whole = 'mjx-container, img, svg, video, button, input';
  const found = [];
  for (const block of document.querySelectorAll('article :is(p, li, dd, td, th, h1, h2, h3, figcaption)')) {
    if (!block.getClientRects().length || block.querySelector(':scope > :is(p, ul, ol)')) continue;
    const lines = [];
    const add = ({ top, bottom, width }, text) => {
      const line = lines.find((l) => (top + bottom) / 2 > l.top && (top + bottom) / 2 < l.bottom);
      if (width && line) line.text += text;
      else if (width) lines.push({ top, bottom, text });
    };
    for (const node of block.querySelectorAll(whole)) add(node.getBoundingClientRect(), 'X');
    const walker = document.createTreeWalker(block, NodeFilter.SHOW_TEXT);
    while (walker.nextNode()) {
      const node = walker.currentNode;
      if (node.parentElement.closest('mjx-container, svg')) continue;
      for (let i = 0; i < node.length; i++) {
        const range = document.createRange();
        range.setStart(node, i);
        range.setEnd(node, i + 1);
        if (node.data[i].trim()) add(range.getBoundingClientRect(), node.data[i]);
      }
    }
    for (const { text } of lines) if (/^[.,;:!?)\]’”]+$/.test(text)) found.push([text, block.textContent.slice(0, 60)]);
  }
  return found;
}"""
SEVERAL = [
    "book/bibliography.html",
    "notebooks/what_happened.html",
    "notebooks/kl_invariance.html",
    "notebooks/ppo.html",
]


def on_a_phone(page: Page, url: str) -> Page:
    page.set_viewport_size(book.PHONE)
    page.goto(url)
    page.evaluate(book.AT_REST)
    return page


# Which file a picture shows, once it has come; and the address of its narrow shape.
SHOWN = """async (node) => {
  while (!node.complete || !node.currentSrc) await new Promise((done) => setTimeout(done, 50));
  return node.currentSrc;
}"""
NARROW = "source => new URL(source.getAttribute('srcset'), location).href"


@pytest.mark.parametrize(
    ("name", "within", "at_least"),
    [
        ("what_happened", ".inbounds-study", 3),
        ("figures_of_the_thesis", ".inbounds-study", 3),
        ("front_page", "figure.inbounds-figure", 1),
        ("ppo", "figure.inbounds-figure", 4),
        ("many_steps_from_one_batch", "figure.inbounds-figure", 2),
    ],
)
def test_six_robots_stand_in_one_column_that_fits_and_so_do_the_panels_of_a_chapter(
    page: Page, address: str, name: str, within: str, at_least: int
) -> None:
    page = on_a_phone(page, f"{address}notebooks/{name}.html")
    pictures = page.locator(f"{within} picture")
    assert pictures.count() >= at_least
    for picture in pictures.all():
        image = picture.locator("img")
        image.scroll_into_view_if_needed()
        assert image.evaluate(SHOWN) == picture.locator("source").evaluate(NARROW)
        assert picture.evaluate(
            "node => ['figure', 'a, figure'].map((each) => node.closest(each))"
            ".every((around) => around.scrollWidth <= around.clientWidth)"
        )
        box = image.bounding_box()
        assert box is not None
        assert 250 < box["width"] <= book.PHONE["width"]
    page.set_viewport_size(book.DESKTOP)
    first = pictures.first
    first.scroll_into_view_if_needed()
    wide = first.locator("img").evaluate("node => new URL(node.getAttribute('src'), location).href")
    image = first.locator("img").element_handle()
    page.wait_for_function("([node, wide]) => node.currentSrc === wide", arg=[image, wide])
    assert wide != first.locator("source").evaluate(NARROW)


@pytest.mark.parametrize(
    ("name", "at_least"),
    [("notebooks/all_tables.html", 6), ("notebooks/objective_bonus_horizon.html", 5)],
)
def test_every_figure_of_the_study_fits(page: Page, address: str, name: str, at_least: int) -> None:
    figures = on_a_phone(page, address + name).locator(".inbounds-study figure:has(img)")
    assert figures.count() >= at_least
    for figure in figures.all():
        assert figure.locator("picture source").count() == 1
        assert figure.evaluate("node => node.scrollWidth <= node.clientWidth")


# Tables of the study whose first number begins where nobody sees it: less than so many pixels of it are in view.
FAR = """tables => tables.map((table) => {
  table.closest('details')?.setAttribute('open', '');
  const row = [...table.querySelectorAll('tbody tr')].find((each) => each.querySelector('td'));
  const number = [...row.cells].find((cell) => !cell.matches('.words, .long'));
  const seen = number ? table.getBoundingClientRect().right - number.getBoundingClientRect().left : 1000;
  return [Math.round(seen), table.caption.textContent.slice(0, 40)];
}).filter(([seen]) => seen < 50)"""


@pytest.mark.parametrize("name", ["notebooks/all_tables.html", "notebooks/objective_bonus_horizon.html"])
def test_the_first_result_stands_beside_the_name(page: Page, address: str, name: str) -> None:
    tables = on_a_phone(page, address + name).locator(".inbounds-study .table table")
    assert tables.count() >= 6
    assert tables.evaluate_all(FAR) == []


@pytest.mark.parametrize("name", SEVERAL)
def test_no_punctuation_stands_alone_on_a_line(page: Page, address: str, name: str) -> None:
    assert on_a_phone(page, address + name).evaluate(LONELY) == []
