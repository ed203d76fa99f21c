"""A formula that is copied is its TeX, and its MathML is whole."""

import pytest
from bs4 import BeautifulSoup, SoupStrainer, Tag
from playwright.sync_api import Page

from tests.pages import browser as book

CHILDREN = {
    "msub": 2,
    "msup": 2,
    "msubsup": 3,
    "munder": 2,
    "mover": 2,
    "munderover": 3,
    "mfrac": 2,
    "mroot": 2,
}
COPIED = """() => {
  const event = new ClipboardEvent('copy', { clipboardData: new DataTransfer(), bubbles: true, cancelable: true });
  document.dispatchEvent(event);
  return event.clipboardData.getData('text/plain');
}"""


def test_copied_formulas_are_tex(page: Page, address: str) -> None:
    names = book.pages("data-tex=")
    if not names:
        pytest.skip("the book was built where npm could not be reached: MathJax has a menu of its own")
    page.goto(address + names[0], wait_until="load")
    formula = page.locator("article p > span.math").first
    tex = formula.get_attribute("data-tex")
    formula.dblclick()
    assert page.evaluate(COPIED) == f"${tex}$"
    page.evaluate("node => getSelection().selectAllChildren(node)", formula.locator("..").element_handle())
    assert f"${tex}$" in page.evaluate(COPIED)


@pytest.mark.parametrize("name", book.pages("<math") or [None])
def test_every_part_of_a_formula_is_there(name: str | None) -> None:
    if name is None:
        pytest.skip("the book was built where npm could not be reached: MathJax sets the formulas later")
    text = (book.HTML / name).read_text(encoding="utf8")
    soup = BeautifulSoup(text, "html.parser", parse_only=SoupStrainer("math"))
    assert soup.find("math")
    parts = soup.find_all(list(CHILDREN))
    counted = [
        (part.name, len(part.find_all(True, recursive=False))) for part in parts if isinstance(part, Tag)
    ]
    assert [each for each in counted if each[1] != CHILDREN[each[0]]] == []
