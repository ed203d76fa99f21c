"""A wrong address, at any depth, shows the book's own page, from which every link leads into the book."""

import json

import pytest
from playwright.sync_api import BrowserContext

from tests.pages import browser as book


@pytest.mark.parametrize("wrong", ["nowhere.html", "book/nowhere.html", "notebooks/a/b/nowhere.html"])
def test_wrong_address_leads_back(context: BrowserContext, address: str, wrong: str) -> None:
    page = context.new_page()
    arrived: set[str] = set()
    page.on("response", lambda response: arrived.add(response.url) if response.status == 200 else None)
    answer = page.goto(address + wrong, wait_until="networkidle")
    assert answer is not None
    assert answer.status == 404
    needed = page.eval_on_selector_all(
        "link[rel=stylesheet], script[src]", "nodes => nodes.map((node) => node.href ?? node.src)"
    )
    assert len(needed) > 5
    assert set(needed) <= arrived
    page.get_by_role("link", name="first page").click()
    assert page.url == address + "notebooks/front_page.html"


def test_nothing_lists_it() -> None:
    index = (book.HTML / "searchindex.js").read_text(encoding="utf-8")
    names = json.loads(index.removeprefix("Search.setIndex(").rstrip(";)\n"))["docnames"]
    assert "notebooks/ppo" in names
    assert "404" not in names
    for name in book.pages():
        if name != "404.html":
            assert "404.html" not in (book.HTML / name).read_text(encoding="utf-8")


def test_first_address_is_described() -> None:
    """What a service reads of a link to the site itself, which redirects."""
    text = (book.HTML / "index.html").read_text(encoding="utf-8")
    assert 'http-equiv="Refresh" content="0; url=notebooks/front_page.html"' in text
    assert '<meta property="og:title" content="In Bounds' in text
    assert '<meta name="description" content="' in text
