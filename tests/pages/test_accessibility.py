"""What axe-core calls serious or critical, in a theme; `test_every_page.py` asks it of every page."""

from pathlib import Path
from typing import Any

import axe_playwright_python
from playwright.sync_api import Page

from tests.pages import browser as book

AXE = Path(axe_playwright_python.__file__).with_name("axe.min.js").read_text(encoding="utf-8")
PAGES = book.pages()
# What goes beforehand: MathJax's glyphs, which have no text and are hidden from screen readers (its MathML stays), and
# the markup of code, of which the first word of each colour and place is enough (the text of the others stays).
THIN_OUT = """() => {
  document.querySelectorAll('mjx-container > mjx-math[aria-hidden=true]').forEach((node) => node.remove());
  const seen = new Set();
  for (const word of document.querySelectorAll('pre span')) {
    const classes = [];
    for (let node = word; node; node = node.parentElement) classes.push(node.className);
    const kind = classes.join('<');
    if (seen.has(kind)) word.replaceWith(...word.childNodes);
    seen.add(kind);
  }
}"""
# axe takes minutes to compare the colours of 30 000 pieces of text, most of which look alike. So it gets the first of
# each kind: the same letters on the same ground and, in a link, within the same letters. Fields have no text to go by.
KINDS = """() => {
  const kinds = new Map(), grounds = new WeakMap();
  const letters = (node) => {
    const { color, fontSize, fontWeight, textDecorationLine, textShadow } = getComputedStyle(node);
    return [color, fontSize, fontWeight, textDecorationLine, textShadow].join();
  };
  const ground = (node) => {
    if (!node) return '';
    if (!grounds.has(node)) {
      const { backgroundColor, backgroundImage, opacity } = getComputedStyle(node);
      const own = [backgroundColor, backgroundImage, opacity].join();
      grounds.set(node, ground(node.parentElement) + (own === 'rgba(0, 0, 0, 0),none,1' ? '' : `|${own}`));
    }
    return grounds.get(node);
  };
  const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (texts.nextNode()) {
    const node = texts.currentNode.parentElement;
    if (!texts.currentNode.data.trim() || !node.checkVisibility()) continue;
    const link = node.closest('a');
    const kind = [letters(node), ground(node), link && letters(link.parentElement)].join('|');
    if (!kinds.has(kind)) kinds.set(kind, node);
  }
  return [...kinds.values(), ...document.querySelectorAll('input, select, textarea')];
}"""
COLOURS = ["color-contrast", "link-in-text-block"]
RUN = f"""async (colours) => {{
  const look = async (where, options) =>
    (await axe.run(where, {{ resultTypes: ['violations'], ...options }})).violations;
  const all = await look({{ include: ({KINDS})() }}, {{ runOnly: colours }});
  if (document.documentElement.dataset.theme === 'light') {{
    const rules = Object.fromEntries(colours.map((rule) => [rule, {{ enabled: false }}]));
    rules['label-content-name-mismatch'] = {{ enabled: true }};
    all.push(...await look(document, {{ rules }}));
  }}
  return all.map(({{ id, impact, nodes }}) =>
    [impact, id, nodes.map((node) => `${{node.target}} ${{node.failureSummary}}`)]);
}}"""
"""Every rule in light, those of colours in either theme."""


def serious(page: Page, theme: str) -> list[Any]:
    """The violations that matter, in a theme."""
    page.evaluate("theme => { document.documentElement.dataset.theme = theme; }", theme)
    # Colours fade over; axe must not read them on their way.
    page.evaluate("() => document.getAnimations().forEach((one) => one.finish())")
    return [found for found in page.evaluate(RUN, COLOURS) if found[0] in ("serious", "critical")]


def test_axe_sees_what_is_wrong(page: Page, address: str) -> None:
    """Text too pale, in one theme only and one of many; a link like its text; a picture without words."""
    page.goto(address + PAGES[0])
    page.evaluate("""() => document.querySelector('article').insertAdjacentHTML('afterbegin', `<img src="x.png">
      <style>html[data-theme=dark] .pale { color: #333; background: #222 }
             html[data-theme=light] .hidden-link { color: #333; text-decoration: none }</style>
      ${'<p>Like any other.</p>'.repeat(20)}<p class="pale">pale</p>
      <pre>${'<span class="k">for</span> '.repeat(9)}<span class="k pale">pale</span></pre>
      <p>A long enough line of text with a link, <a class="hidden-link" href="index.html">hidden</a> in it.</p>`)""")
    page.evaluate(THIN_OUT)
    page.evaluate(AXE)
    assert sorted(found[1] for found in serious(page, "light")) == ["image-alt", "link-in-text-block"]
    ((_, rule, where),) = serious(page, "dark")
    assert rule == "color-contrast"
    paragraph, word = where
    assert ".pale" in paragraph
    assert ".k.pale" in word
