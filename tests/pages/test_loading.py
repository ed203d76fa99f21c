"""What a page leaves for later: BokehJS until an explorable is near. A place asked for is found all the same."""

import pytest
from playwright.sync_api import BrowserContext, Page

from tests.pages import browser as book

FAR = "notebooks/ppo.html"  # its explorable stands several screens down
FIRST_IS_LIVE = "document.querySelector('.inbounds-explorable').dataset.state === 'live'"
LAID_OUT = "node => node.checkVisibility({ contentVisibilityAuto: true })"
END = "section#summary > p, section#summary li"
IN_VIEW = """(() => {
  const { top } = document.querySelector('#exercises > h2').getBoundingClientRect();
  return top >= 0 && top < innerHeight / 2;
})()"""
SHIFTS = """window.shifts = 0;
new PerformanceObserver((list) => {
  for (const each of list.getEntries()) if (!each.hadRecentInput) window.shifts += each.value;
}).observe({ type: 'layout-shift', buffered: true });"""


def opened(context: BrowserContext, url: str, asked: list[str] | None = None) -> Page:
    page = context.new_page()
    page.set_viewport_size(book.PHONE)
    page.add_init_script(SHIFTS)
    if asked is not None:
        page.on("request", lambda request: asked.append(request.url) if "/bokeh" in request.url else None)
    page.goto(url)  # until its load event, for which scripts that it has asked for so far are waited
    page.wait_for_timeout(500)
    return page


def test_bokeh_comes_when_an_explorable_is_near(context: BrowserContext, address: str) -> None:
    asked: list[str] = []
    page = opened(context, address + FAR, asked)
    assert asked == []
    page.locator(".inbounds-explorable").first.scroll_into_view_if_needed()
    page.wait_for_function(FIRST_IS_LIVE)
    assert len(asked) == 2
    page.evaluate(book.EVERYTHING)
    page.keyboard.press("Tab")
    page.wait_for_timeout(300)
    assert len(asked) == 2, "asked for again"


@pytest.mark.parametrize("by", ["the Tab key", "who asks for everything"])
def test_bokeh_comes_for(context: BrowserContext, address: str, by: str) -> None:
    asked: list[str] = []
    page = opened(context, address + FAR, asked)
    assert asked == []
    if by == "the Tab key":
        page.keyboard.press("Tab")
    else:
        page.evaluate(book.EVERYTHING)
    page.wait_for_function(FIRST_IS_LIVE)


def test_on_paper_nobody_needs_bokeh(context: BrowserContext, address: str) -> None:
    asked: list[str] = []
    page = opened(context, address + FAR, asked)
    page.emulate_media(media="print")
    page.wait_for_timeout(300)
    assert page.locator(".inbounds-static img").first.is_visible()
    assert page.locator(END).last.evaluate(LAID_OUT)
    assert asked == []


@pytest.mark.parametrize("name", ["notebooks/front_page.html", FAR])
def test_a_page_is_steady_while_it_opens_and_is_read(
    context: BrowserContext, address: str, name: str
) -> None:
    """The sum of all shifts, of which Google's bar for good is a tenth in the worst five seconds."""
    page = opened(context, address + name)
    for _ in range(60):
        page.mouse.wheel(0, 500)
        page.wait_for_timeout(50)
    page.wait_for_timeout(500)
    assert page.evaluate("shifts") <= 0.05


@pytest.mark.parametrize("way", ["from another page", "by a link of this page", "again"])
def test_a_place_in_the_middle_is_found(context: BrowserContext, address: str, way: str) -> None:
    page = opened(context, address + FAR + ("" if way == "by a link of this page" else "#exercises"))
    if way == "by a link of this page":
        page.evaluate("document.querySelector(\"a[href='#exercises']\").click()")
    page.wait_for_function(IN_VIEW)  # the theme scrolls smoothly
    if way == "again":
        page.reload(wait_until="networkidle")
        page.wait_for_function(IN_VIEW)
    assert page.locator(END).last.evaluate(LAID_OUT)
    page.wait_for_timeout(500)
    assert page.evaluate(IN_VIEW), "it moved on"
