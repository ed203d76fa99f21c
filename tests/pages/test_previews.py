"""What a link leads to is shown beside it, and nothing is loaded for it before."""

import re

import pytest
from playwright.sync_api import Page

from tests.pages import browser as book

KINDS = {"statement": "thm-", "equation": "equation-", "source": "bibliography.html#id"}
APART = """() => {
  const [a, b] = ['[aria-describedby=inbounds-preview]', '#inbounds-preview'].map((one) => document.querySelector(one))
    .map((node) => node.getBoundingClientRect());
  return b.top >= a.bottom || b.bottom <= a.top || b.left >= a.right || b.right <= a.left;
}"""


def opened(page: Page, start: str, kind: str) -> Page:
    """A page with a link of this kind, and the link in sight."""
    part = KINDS[kind]
    written = re.compile(rf'<a class="reference internal" href="[^"]*{part}')
    names = [
        name for name in book.pages(part) if written.search((book.HTML / name).read_text(encoding="utf-8"))
    ]
    for name in names:
        page.goto(start + name)
        links = page.locator(f'article a.reference.internal[href*="{part}"]:visible')
        if links.count():
            links.first.scroll_into_view_if_needed()
            links.first.evaluate("node => { node.dataset.tried = ''; }")
            return page
    raise AssertionError(f"no link to a {kind}")


@pytest.mark.parametrize("scheme", ["http", "file"])
@pytest.mark.parametrize("kind", KINDS)
def test_a_pointer_that_rests_sees_it(page: Page, address: str, scheme: str, kind: str) -> None:
    opened(page, address if scheme == "http" else f"{book.HTML.as_uri()}/", kind)
    assert not page.locator("script[src$='.html.js']").count()
    page.locator("[data-tried]").hover()
    preview = page.locator("#inbounds-preview")
    preview.wait_for()
    assert preview.inner_text().strip()
    assert page.evaluate(APART)
    preview.hover()
    page.wait_for_timeout(500)
    assert preview.is_visible()
    page.keyboard.press("Escape")
    assert preview.is_hidden()
    assert page.locator("[aria-describedby=inbounds-preview]").count() == 0


def test_a_focused_link_has_it_too(page: Page, address: str) -> None:
    page = opened(page, address, "statement")
    page.keyboard.press("Tab")
    page.locator("[data-tried]").focus()
    page.locator("#inbounds-preview[role=tooltip]").wait_for()
    assert page.evaluate("document.activeElement.getAttribute('aria-describedby')") == "inbounds-preview"
    page.keyboard.press("Tab")
    page.wait_for_function("() => !document.querySelector('[data-tried]').hasAttribute('aria-describedby')")


def test_it_goes_when_the_pointer_goes_to_a_link_without_one(page: Page, address: str) -> None:
    page = opened(page, address, "statement")
    page.locator("[data-tried]").hover()
    page.locator("#inbounds-preview").wait_for()
    page.locator("[data-tried]").evaluate(
        """node => {
          const other = document.createElement('a');
          const is = { href: 'preface.html#no-such', className: 'reference internal', textContent: 'elsewhere' };
          Object.assign(other, is);
          node.before(other, ' ');
        }"""
    )
    page.get_by_role("link", name="elsewhere").hover()
    page.locator("#inbounds-preview").wait_for(state="hidden", timeout=3000)
