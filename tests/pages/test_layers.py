"""Two layers, one switch: code is folded for who reads, open for who asks for it, and open for who has no scripts."""

import pytest
from playwright.sync_api import Browser, BrowserContext, Page

from tests.pages import browser as book

FOLDING = '<details class="inbounds-code" open>'
STATES = "nodes => nodes.map((node) => [node.open, node.matches('.stays-open')])"
PAGES = book.pages(FOLDING)
SEVERAL = [
    "notebooks/actions_have_bounds.html",
    "notebooks/ppo.html",
    "notebooks/reinforce_with_every_family.html",
    "notebooks/what_happened.html",
    "notebooks/logit_normal_moments.html",
    "notebooks/objective_bonus_horizon.html",
]


def folds(page: Page) -> list[list[bool]]:
    """Of every fold whether it is open, and whether it stays so."""
    found: list[list[bool]] = page.eval_on_selector_all("details.inbounds-code", STATES)
    assert found
    return found


def wait_until(page: Page, is_open: str) -> None:
    """Until every fold is as a script says (a page beside another learns of its choice a moment later)."""
    page.wait_for_function(
        f"[...document.querySelectorAll('details.inbounds-code')].every((node) => {is_open})"
    )


def test_some_page_has_code() -> None:
    assert set(SEVERAL) <= set(PAGES)


def test_code_is_folded_for_readers_and_opens_by_itself(context: BrowserContext, address: str) -> None:
    page = context.new_page()
    page.goto(address + PAGES[0])
    assert all(is_open == stays for is_open, stays in folds(page))
    fold = page.locator("details.inbounds-code:not(.stays-open)").first
    assert fold.locator(".first-line").inner_text().strip()
    fold.locator("summary").focus()
    page.keyboard.press("Enter")
    assert fold.locator(".cell_input").is_visible()
    assert sum(is_open and not stays for is_open, stays in folds(page)) == 1


@pytest.mark.parametrize("scheme", ["http", "file"])
def test_switch_is_remembered_on_other_pages(context: BrowserContext, address: str, scheme: str) -> None:
    start = address if scheme == "http" else f"{book.HTML.as_uri()}/"
    page = context.new_page()
    page.goto(start + PAGES[0])
    switch = page.locator(".btn-layer-button")
    assert switch.get_attribute("aria-pressed") == "false"
    switch.focus()
    page.keyboard.press("Enter")
    assert switch.get_attribute("aria-pressed") == "true"
    assert all(is_open for is_open, _ in folds(page))
    page.goto(start + PAGES[-1])
    wait_until(page, "node.open")
    page.locator(".btn-layer-button").click()
    assert all(is_open == stays for is_open, stays in folds(page))


@pytest.mark.parametrize("scheme", ["http", "file"])
def test_a_page_beside_it_follows_the_switch(context: BrowserContext, address: str, scheme: str) -> None:
    start = address if scheme == "http" else f"{book.HTML.as_uri()}/"
    first, beside = context.new_page(), context.new_page()
    first.goto(start + PAGES[0])
    beside.goto(start + PAGES[-1])
    for is_open in ("node.open", "node.open === node.matches('.stays-open')"):
        first.locator(".btn-layer-button").click()
        wait_until(beside, is_open)
    assert beside.locator(".btn-layer-button").get_attribute("aria-pressed") == "false"


def test_without_scripts_everything_is_open(browser: Browser, address: str) -> None:
    context = browser.new_context(java_script_enabled=False)
    page = context.new_page()
    page.goto(address + PAGES[0])
    inputs = page.locator("details.inbounds-code > .cell_input")
    assert inputs.count() > 0
    assert page.locator("details.inbounds-code:not([open])").count() == 0
    assert page.locator(".btn-layer-button").is_hidden()
    context.close()


def test_paper_has_no_folds(page: Page, address: str) -> None:
    page.goto(address + PAGES[0])
    folded = page.locator("article details:not([open])")
    before = folded.count()
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert folded.count() == 0
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    assert folded.count() == before


@pytest.mark.parametrize("name", SEVERAL)
def test_nothing_moves_while_a_page_opens_with_its_code(
    context: BrowserContext, address: str, name: str
) -> None:
    """`test_every_page.py` has all of them without."""
    assert book.shift_of(context, address + name, "code") <= book.STEADY


@pytest.mark.parametrize("name", ["notebooks/untrained_returns.html", "notebooks/trpo.html"])
def test_nothing_moves_on_a_slow_processor(context: BrowserContext, address: str, name: str) -> None:
    """A page is painted before the whole of it has come: its scrollbar must not push it aside."""
    page = context.new_page()
    context.new_cdp_session(page).send("Emulation.setCPUThrottlingRate", {"rate": 6})
    page.route("**/mathjax/*.js", lambda route: route.abort())
    page.add_init_script(book.SHIFT)
    page.goto(address + name, wait_until="networkidle", timeout=60_000)
    page.evaluate(book.AT_REST)
    assert page.evaluate("window.shift") <= book.STEADY


def test_icons_are_drawn_by_a_small_font(context: BrowserContext, address: str) -> None:
    page = context.new_page()
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.goto(address + PAGES[0], wait_until="networkidle")
    assert not [url for url in asked if "fontawesome.js" in url]
    (font,) = [url for url in asked if "webfonts" in url]
    assert (book.HTML / font.removeprefix(address).partition("?")[0]).stat().st_size < 20_000
    assert page.evaluate("document.fonts.check('900 16px \"Font Awesome 6 Free\"', '\\uf019')")
