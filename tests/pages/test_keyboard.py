"""A reader who has only the Tab key."""

from playwright.sync_api import BrowserContext, Page

from tests.pages import browser as book


def with_most_formulas() -> str:
    """Were a formula a stop, it would be found on this page. (Whoever only collects tests may have built no book.)"""
    return max(
        book.pages("math notranslate"),
        key=lambda name: (book.HTML / name).read_text(encoding="utf-8").count("math notranslate"),
    )


MOST_STOPS = 2000
FOCUSED = """() => {
  const node = document.activeElement;
  const style = getComputedStyle(node);
  const ring = (style.outlineStyle !== 'none' && parseFloat(style.outlineWidth) >= 2) || style.boxShadow !== 'none';
  return { what: node.outerHTML.slice(0, 150), body: node === document.body, ring,
           control: node.matches('a[href], button, input, select, summary, video, [role=slider], [role=button]'),
           scrolls: node.scrollWidth > node.clientWidth || node.scrollHeight > node.clientHeight,
           formula: !!node.closest('span.math'), header: !!node.closest('.bd-header-article, .bd-header'),
           inside: !!node.shadowRoot };
}"""


def stops(page: Page) -> list[dict[str, object]]:
    """Every stop of the Tab key, until the focus leaves the page."""
    found: list[dict[str, object]] = []
    for _ in range(MOST_STOPS):
        page.keyboard.press("Tab")
        focused = page.evaluate(FOCUSED)
        if focused["body"] or (found and focused["what"] == found[0]["what"]):
            return found
        found.append(focused)
    raise AssertionError(f"more than {MOST_STOPS} stops")


def test_tab_leads_through_links_and_controls_alone(page: Page, address: str) -> None:
    page.goto(address + with_most_formulas(), wait_until="networkidle")
    page.evaluate(book.AT_REST)
    assert page.locator("article span.math mjx-container").count() > 100
    found = stops(page)
    assert len(found) > 50
    assert [stop["what"] for stop in found if stop["formula"]] == []
    assert [
        stop["what"] for stop in found if not (stop["control"] or stop["scrolls"] or stop["inside"])
    ] == []
    # Mathematics is still there for a screen reader.
    formulas = page.locator("article mjx-container")
    assert page.locator("article mjx-container > mjx-assistive-mml > math").count() == formulas.count()


def test_what_has_the_focus_shows_it(context: BrowserContext, address: str) -> None:
    for theme in ("light", "dark"):
        page = context.new_page()
        page.add_init_script(book.choose_theme(theme))
        page.goto(address + "book/preface.html", wait_until="networkidle")
        found = stops(page)
        assert sum(bool(stop["header"]) for stop in found) >= 4  # search, theme, full screen, download …
        assert [stop["what"] for stop in found if not stop["ring"]] == []
        page.close()
