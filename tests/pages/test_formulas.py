"""A formula that is copied is its TeX."""

import pytest
from playwright.sync_api import BrowserContext

from tests.pages import browser as book

COPIED = """() => {
  const event = new ClipboardEvent('copy', { clipboardData: new DataTransfer(), bubbles: true, cancelable: true });
  document.dispatchEvent(event);
  return event.clipboardData.getData('text/plain');
}"""


def test_copied_formulas_are_tex(context: BrowserContext, address: str) -> None:
    names = book.pages("data-tex=")
    if not names:
        pytest.skip("the book was built where npm could not be reached: MathJax has a menu of its own")
    page = context.new_page()
    page.goto(address + names[0], wait_until="load")
    formula = page.locator("article p > span.math").first
    tex = formula.get_attribute("data-tex")
    formula.dblclick()
    assert page.evaluate(COPIED) == f"${tex}$"
    page.evaluate("node => getSelection().selectAllChildren(node)", formula.locator("..").element_handle())
    assert f"${tex}$" in page.evaluate(COPIED)
