"""What must hold on every page of the built book."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import unquote, urldefrag, urljoin, urlsplit

import pytest
from playwright.sync_api import Browser, ConsoleMessage, Error, Page, Request, Response

from tests.book.test_extension import load
from tests.pages import browser as book
from tests.pages.test_accessibility import AXE, THIN_OUT, serious

PAGES = book.pages()
LOCAL_SCHEMES = {"data", "blob", "about"}


@dataclass
class Visit:
    """A page that was opened, and all that happened meanwhile."""

    name: str
    address: str
    page: Page
    shift: float = 0.0
    requests: list[str] = field(default_factory=list)
    bad_responses: list[str] = field(default_factory=list)
    complaints: list[str] = field(default_factory=list)

    def on_request(self, request: Request) -> None:
        self.requests.append(request.url)

    def on_response(self, response: Response) -> None:
        if response.status != 200:
            self.bad_responses.append(f"{response.status} {response.url}")

    def on_failure(self, request: Request) -> None:
        self.bad_responses.append(f"{request.failure} {request.url}")

    def on_exception(self, error: Error) -> None:
        self.complaints.append(f"exception: {error}")

    def on_console(self, message: ConsoleMessage) -> None:
        if message.type in ("error", "warning", "assert"):
            self.complaints.append(f"{message.type}: {message.text}")


@pytest.fixture(scope="module", params=PAGES)
def visit(request: pytest.FixtureRequest, window: Page, address: str) -> Iterator[Visit]:
    """The page, opened once and read by all tests of this file; nothing of it has been loaded before."""
    with book.lent(window) as page:
        visit = Visit(request.param, address, page)
        listeners: dict[Any, Callable[[Any], None]] = {
            "request": visit.on_request,
            "response": visit.on_response,
            "requestfailed": visit.on_failure,
            "console": visit.on_console,
            "pageerror": visit.on_exception,
        }
        for event, listener in listeners.items():
            page.on(event, listener)
        cache = page.context.new_cdp_session(page)
        cache.send("Network.enable")
        cache.send("Network.setCacheDisabled", {"cacheDisabled": True})
        page.goto(address + request.param, wait_until="networkidle")
        page.evaluate(book.AT_REST)
        visit.shift = page.evaluate("window.shift")
        yield visit
        for event, listener in listeners.items():
            page.remove_listener(event, listener)
        cache.detach()


@pytest.fixture(scope="module", params=["desktop", "phone"])
def width(request: pytest.FixtureRequest, visit: Visit) -> str:
    """Of the page, which is laid out anew once for all tests of a width."""
    visit.page.set_viewport_size(book.WINDOWS[request.param])
    visit.page.evaluate(book.AT_REST)
    return str(request.param)


def test_the_book_is_built() -> None:
    assert PAGES, f"no pages in {book.HTML}: run `make book`, or set INBOUNDS_HTML"


def test_the_first_page_leads_into_the_book(browser: Browser, address: str) -> None:
    page = browser.new_page()
    page.goto(address)
    page.wait_for_selector("article h1")
    assert page.url.removeprefix(address) in {*PAGES, "index.html", ""}
    page.close()


def test_nothing_is_asked_of_another_host(visit: Visit) -> None:
    elsewhere = [
        url
        for url in visit.requests
        if urlsplit(url).scheme not in LOCAL_SCHEMES and not url.startswith(visit.address)
    ]
    assert elsewhere == []


def test_all_that_the_page_asks_for_is_there(visit: Visit) -> None:
    assert visit.bad_responses == []
    assert len(visit.requests) > 5  # the page, its styles, its scripts


def test_nothing_moves_while_it_opens(visit: Visit) -> None:
    if visit.shift > book.STEADY:  # the first look, on a busy machine
        context = visit.page.context.browser.new_context(viewport=book.DESKTOP)
        assert book.shift_of(context, visit.address + visit.name, "read") <= book.STEADY
        context.close()


def test_console_is_clean(visit: Visit) -> None:
    assert visit.complaints == []


def test_mathematics_is_typeset(visit: Visit) -> None:
    """Every formula became MathJax's output, without an error in it."""
    assert visit.page.locator("mjx-merror, mjx-container [data-mjx-error]").all_text_contents() == []
    raw = "nodes => nodes.filter((node) => !node.querySelector('mjx-container')).map((node) => node.textContent)"
    assert visit.page.eval_on_selector_all("article .math", raw) == []


def test_formulas_were_set_before_the_page_was_opened(visit: Visit) -> None:
    source = (book.HTML / visit.name).read_text(encoding="utf-8")
    if "mathjax/tex-chtml.js" in source:
        pytest.skip(
            "the book was built where npm could not be reached: MathJax sets its formulas in the browser"
        )
    assert source.count("math notranslate") == source.count("<mjx-container")
    glyphs = """nodes => nodes.filter((node) => getComputedStyle(node, '::before').content === 'none')
      .map((node) => node.className)"""
    assert visit.page.eval_on_selector_all("article mjx-c", glyphs) == []


def test_scrollbars_are_shown(visit: Visit) -> None:
    """Else nobody would see those of the next test."""
    width = """() => {
      const box = document.body.appendChild(document.createElement('div'));
      box.style.cssText = 'width: 100px; height: 100px; overflow: scroll';
      const width = box.offsetWidth - box.clientWidth;
      box.remove();
      return width;
    }"""
    assert visit.page.evaluate(width) > 5


def test_no_formula_in_a_line_of_text_scrolls(visit: Visit) -> None:
    scrolling = """nodes => nodes.filter((formula) => [formula, ...formula.querySelectorAll('*')].some((node) => {
      const { overflowX, overflowY } = getComputedStyle(node);
      return (/auto|scroll/.test(overflowX) && node.scrollWidth > node.clientWidth)
          || (/auto|scroll/.test(overflowY) && node.scrollHeight > node.clientHeight);
    })).map((formula) => formula.textContent)"""
    assert visit.page.eval_on_selector_all("article span.math", scrolling) == []


def test_a_formula_in_a_line_of_its_own_fits_on_a_desk(visit: Visit) -> None:
    wide = """nodes => nodes.filter((node) => node.checkVisibility() && node.scrollWidth > node.clientWidth + 1)
      .map((node) => node.textContent)"""
    assert visit.page.eval_on_selector_all("article mjx-container[display]", wide) == []


@pytest.mark.usefixtures("width")
def test_formulas_in_text_are_not_cut_off(visit: Visit) -> None:
    """Nothing but the page's own column bounds them, and they fit in it."""
    cut = """nodes => nodes.filter((formula) => {
      let column = formula.parentElement;
      while (getComputedStyle(column).display.startsWith('inline')) column = column.parentElement;
      const scrolls = (node) =>
        node && (/auto|scroll/.test(getComputedStyle(node).overflowX) || scrolls(node.parentElement));
      return getComputedStyle(formula).overflowX !== 'visible' || (!scrolls(column.closest('article *'))
        && [...formula.getClientRects()].some((box) => box.right > column.getBoundingClientRect().right + 2));
    }).map((formula) => formula.textContent)"""
    assert visit.page.eval_on_selector_all("article span.math", cut) == []


def at_rest(visit: Visit, selector: str, script: str) -> list[str]:
    """What a script finds, within five seconds: theme and book look again a moment after the width has changed."""
    for _ in range(50):
        if not (found := visit.page.eval_on_selector_all(selector, script)):
            break
        visit.page.wait_for_timeout(100)
    return found


@pytest.mark.usefixtures("width")
def test_what_scrolls_is_reached_by_keyboard_and_has_a_name(visit: Visit) -> None:
    unnamed = """nodes => nodes.filter((node) => node.checkVisibility() && node.scrollWidth > node.clientWidth + 1
        && /auto|scroll/.test(getComputedStyle(node).overflowX))
      .filter((node) => node.tabIndex !== 0 || !(node.caption?.textContent ?? node.ariaLabel)?.trim())
      .map((node) => node.outerHTML.slice(0, 120))"""
    tables = "article table:not(.inbounds-explorable table), article mjx-container"
    assert at_rest(visit, tables, unnamed) == []


@pytest.mark.parametrize("width", ["desktop"], indirect=True)
@pytest.mark.usefixtures("width")
def test_only_controls_and_what_scrolls_are_tab_stops(visit: Visit) -> None:
    others = """nodes => nodes.filter((node) => node.tabIndex >= 0 && node.checkVisibility()
        && !node.matches('a, button, input, select, textarea, summary, video, [role=slider], [role=button]')
        && node.scrollWidth <= node.clientWidth && node.scrollHeight <= node.clientHeight)
      .map((node) => node.outerHTML.slice(0, 120))"""
    assert at_rest(visit, "[tabindex]", others) == []


def test_page_describes_itself(visit: Visit) -> None:
    """To search engines and in previews: not in a picture's markup, nor in TeX."""
    if visit.name == "404.html":
        assert visit.page.locator("meta[name=robots]").get_attribute("content") == "noindex"
        return
    described = visit.page.locator("meta[name=description]").get_attribute("content")
    assert described
    assert 20 < len(described) <= 200
    assert not set(described) & set("\\${}<>")
    tag = visit.page.locator
    assert tag("meta[property='og:description']").get_attribute("content") == described
    assert tag("meta[property='og:title']").get_attribute("content") in visit.page.title()


def test_images_have_alt_text(visit: Visit) -> None:
    """Words, not the file's name, which docutils puts where no alt text is given."""
    images = visit.page.eval_on_selector_all(
        "main img", "nodes => nodes.map((node) => [node.alt, node.src.slice(0, 80)])"
    )
    bad = [
        (alt, src)
        for alt, src in images
        if len(alt.split()) < 3 or alt.endswith((".png", ".svg", ".jpg", ".jpeg"))
    ]
    assert bad == []


def test_images_are_drawn(visit: Visit) -> None:
    broken = """nodes => nodes.filter((node) => node.loading !== 'lazy' && !node.naturalWidth)
                              .map((node) => node.src.slice(0, 80))"""
    assert visit.page.eval_on_selector_all("main img", broken) == []


def test_videos_wait_for_the_reader(visit: Visit) -> None:
    wrong = """nodes => nodes.filter((v) => !v.controls || v.autoplay || v.loop || !v.getAttribute('aria-label'))
                             .map((v) => v.outerHTML.slice(0, 120))"""
    assert visit.page.eval_on_selector_all("video", wrong) == []


@pytest.mark.usefixtures("width")
def test_one_search_box(visit: Visit) -> None:
    fields = visit.page.locator("input[type=search]:visible").count()
    buttons = visit.page.locator(".search-button__button:visible").count()
    if visit.name == "search.html":  # the page of results has its own field
        assert fields == 1
    else:
        assert fields + buttons == 1


@pytest.mark.parametrize("width", ["small-window", "phone"], indirect=True)
@pytest.mark.usefixtures("width")
def test_nothing_but_a_table_scrolls_sideways(visit: Visit) -> None:
    too_wide = """() => {
      const limit = document.documentElement.clientWidth;
      const scrolls = (node) => node && (getComputedStyle(node).overflowX !== 'visible' || scrolls(node.parentElement));
      return document.documentElement.scrollWidth <= limit ? [] :
        [...document.querySelectorAll('main *')]
          .filter((node) => node.getBoundingClientRect().right > limit + 1 && !scrolls(node.parentElement))
          .map((node) => node.outerHTML.slice(0, 120)).concat(`${document.documentElement.scrollWidth} px`);
    }"""
    assert visit.page.evaluate(too_wide) == []


def test_links_inside_the_book_lead_somewhere(visit: Visit) -> None:
    """The file exists, and so does the place in it that the link names."""
    targets = visit.page.eval_on_selector_all(
        "a[href]:not([href^='#study?'])",  # but the explorer's own addresses, of which it has a test
        "nodes => nodes.map((node) => node.getAttribute('href'))",
    )
    dead = []
    for target in sorted(set(targets)):
        url, fragment = urldefrag(urljoin(visit.address + visit.name, target))
        if not url.startswith(visit.address):
            continue
        path = book.HTML / unquote(urlsplit(url).path).lstrip("/")
        if not path.is_file():
            dead.append(target)
        elif fragment and path.suffix == ".html":
            text, anchor = path.read_text(encoding="utf-8"), unquote(fragment)
            if f'id="{anchor}"' not in text and f'name="{anchor}"' not in text:
                dead.append(target)
    assert dead == []


def test_some_page_has_figures() -> None:
    assert book.pages('<figure class="inbounds-figure">')


def test_figures_are_numbered_and_say_what_their_alt_text_says(visit: Visit) -> None:
    told = visit.page.eval_on_selector_all(
        "figure.inbounds-figure",
        """nodes => nodes.map((node) => [node.querySelector('.number').textContent, node.querySelector('img').alt,
          [...node.querySelectorAll('[aria-hidden], details > p')].map((part) => part.textContent).join(' ')])""",
    )
    as_printed = load("layers").as_printed
    numbers = visit.page.locator("figure > figcaption > .number").all_text_contents()
    assert numbers == [f"Figure {i}." for i in range(1, len(numbers) + 1)]
    assert {number for number, _, _ in told} <= set(numbers)
    assert all(as_printed(alt) == caption for _, alt, caption in told)


def test_axe_finds_nothing_serious_in_either_theme(visit: Visit) -> None:
    """The last one, because it thins the page out."""
    visit.page.set_viewport_size(book.DESKTOP)
    visit.page.wait_for_timeout(400)  # 0.3 s after a new width the theme looks for what scrolls anew
    visit.page.evaluate(book.AT_REST)
    visit.page.evaluate(THIN_OUT)
    visit.page.evaluate(AXE)
    assert serious(visit.page, "light") == []
    assert serious(visit.page, "dark") == []
