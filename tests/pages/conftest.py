"""One server and one browser for every worker."""

import re
from collections.abc import Iterator
from typing import Any

import pytest
from playwright.sync_api import Browser, BrowserContext, Page
from xdist.scheduler import LoadScopeScheduling

from tests.pages import browser as book

SHARED = ("test_firefox.py", "test_live_robot.py", "test_on_paper.py")
"""Modules that make something at some cost, for all of their tests."""


class PageByPage(LoadScopeScheduling):
    """Gives what is asked of one page to one worker, so that the page is opened once; likewise what a module shares.

    (`--dist loadgroup` would do that by marks; pytest-xdist 3.8 cannot tell pytest 9.2 of them, and says nothing.)
    """

    def _split_scope(self, nodeid: str) -> str:
        module = nodeid.partition("::")[0].rpartition("/")[2]
        if module in SHARED:
            return module
        page = re.search(r"\[.*?([\w/]+\.html)", nodeid)
        return page[1] if page else nodeid


@pytest.hookimpl(optionalhook=True)  # nobody asks where pytest-xdist is switched off
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> PageByPage:
    """Deal the tests out to the workers."""
    return PageByPage(config, log)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Everything in this folder needs the built book and a browser."""
    for item in items:
        if "tests/pages" in item.path.as_posix():
            item.add_marker(pytest.mark.pages)


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


@pytest.fixture(scope="session")
def _window(browser: Browser) -> Page:
    return book.new_window(browser)


@pytest.fixture(scope="session")
def window(browser: Browser) -> Page:
    """For fixtures that keep a page open through a module: `book.lent(window)` gives it to one of them."""
    window = book.new_window(browser)
    window.add_init_script(book.SHIFT)
    return window


@pytest.fixture
def page(_window: Page) -> Iterator[Page]:
    """An empty page for a new reader; who needs several, or scripts that run first, takes a `context`."""
    with book.lent(_window) as page:
        yield page


@pytest.fixture
def context(browser: Browser) -> Iterator[BrowserContext]:
    """A fresh reader: no cookies, no theme chosen."""
    fresh = browser.new_context(viewport=book.DESKTOP)
    fresh.set_default_timeout(20_000)
    yield fresh
    fresh.close()
