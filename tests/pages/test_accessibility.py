"""What axe-core calls serious or critical, in a theme; `test_every_page.py` asks it of every page."""

from pathlib import Path
from typing import Any

import axe_playwright_python
from playwright.sync_api import BrowserContext, Page

from tests.pages import browser as book

AXE = Path(axe_playwright_python.__file__).with_name("axe.min.js").read_text(encoding="utf-8")
PAGES = book.pages()
# axe takes minutes for a page of 30 000 elements, most of which look alike. What goes beforehand: MathJax's glyphs,
# which have no text and are hidden from screen readers (its MathML stays), and the colour of every piece of code but
# the first of its kind, in its surroundings.
THIN_OUT = """() => {
  document.querySelectorAll('mjx-container > mjx-math[aria-hidden=true]').forEach((node) => node.remove());
  const kinds = new Set();
  for (const node of [...document.querySelectorAll('.highlight pre span, dt.sig :is(span, em), code span')].reverse()) {
    if (node.childElementCount || node.id) continue;
    const around = node.closest('.admonition, .proof, .sd-card, details, td, th, dt, a')?.className;
    const kind = [node.className, node.parentElement.className, around].join('|');
    if (kinds.has(kind)) node.replaceWith(node.textContent);
    kinds.add(kind);
  }
  document.body.normalize();
}"""
RUN = """options => axe.run(document, { resultTypes: ['violations'], ...options }).then(({ violations }) =>
  violations.map(({ id, impact, nodes }) =>
    [impact, id, nodes.map((node) => `${node.target} ${node.failureSummary}`)]))"""
EVERYTHING: dict[str, Any] = {"rules": {"label-content-name-mismatch": {"enabled": True}}}
COLOURS = {"runOnly": ["color-contrast", "link-in-text-block"]}


def serious(page: Page, theme: str, options: dict[str, Any]) -> list[Any]:
    """The violations that matter, in a theme."""
    page.evaluate("theme => { document.documentElement.dataset.theme = theme; }", theme)
    # Colours fade over; axe must not read them on their way.
    page.evaluate("() => Promise.all(document.getAnimations().map((one) => one.finished.catch(() => null)))")
    return [found for found in page.evaluate(RUN, options) if found[0] in ("serious", "critical")]


def test_axe_sees_what_is_wrong(context: BrowserContext, address: str) -> None:
    """Text too pale, in one theme only, and a picture without words."""
    page = context.new_page()
    page.goto(address + PAGES[0])
    page.evaluate("""() => document.querySelector('article').insertAdjacentHTML('afterbegin', `<img src="x.png">
      <style>html[data-theme=dark] .pale { color: #333; background: #222 }</style><p class="pale">pale</p>`)""")
    page.evaluate(THIN_OUT)
    page.evaluate(AXE)
    assert [found[1] for found in serious(page, "light", EVERYTHING)] == ["image-alt"]
    assert "color-contrast" in [found[1] for found in serious(page, "dark", COLOURS)]
