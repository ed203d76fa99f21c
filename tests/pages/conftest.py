"""One server and one browser for every worker."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, BrowserContext

from tests.pages import browser as book

SHARED = {"seen": "Firefox", "webgl": "WebGL", "tool": "paper"}
"""Fixtures of a module that are made at some cost, and what they are called among the workers."""
PER_PAGE = ("visit", "opened")
"""Fixtures of a module that open a page once; the workers call them by the page's name."""


@pytest.hookimpl(tryfirst=True)  # before pytest-xdist reads the groups
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Everything in this folder needs the built book and a browser; what shares a visit goes to one worker."""
    for item in items:
        if "tests/pages" in item.path.as_posix():
            item.add_marker(pytest.mark.pages)
            given = item.callspec.params if hasattr(item, "callspec") else {}
            made = getattr(item, "fixturenames", ())
            groups = [name for fixture, name in SHARED.items() if fixture in made]
            groups += [given[fixture] for fixture in PER_PAGE if fixture in given]
            for group in groups:
                item.add_marker(pytest.mark.xdist_group(group))


@pytest.fixture(scope="session")
def address() -> Iterator[str]:
    """Where the built book is served, ending in a slash."""
    if not (book.HTML / "index.html").exists():
        pytest.fail(f"no built book in {book.HTML}: run `make book`, or set INBOUNDS_HTML", pytrace=False)
    with book.served(book.HTML) as url:
        yield url


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """A headless Chromium."""
    try:
        book.find_chromium()
    except RuntimeError as error:
        pytest.fail(str(error), pytrace=False)
    with book.chromium() as running:
        yield running


@pytest.fixture
def context(browser: Browser) -> Iterator[BrowserContext]:
    """A fresh reader: no cookies, no theme chosen."""
    fresh = browser.new_context(viewport=book.DESKTOP)
    fresh.set_default_timeout(20_000)
    yield fresh
    fresh.close()
