"""Explorables in the built book: they render, answer the keyboard, follow the theme, and leave a figure behind."""

import math
import re
from collections.abc import Iterator

import pytest
import torch
from playwright.sync_api import BrowserContext, Locator, Page

from inbounds.book.explorables.bounded_densities import bounded_densities
from inbounds.book.explorables.frame import javascript_files
from inbounds.distributions import LogitNormal
from tests.pages import browser as book

PAGES = book.pages('class="inbounds-explorable"')
# Alphas of everything painted on the canvases below a node, shadow roots included.
PAINTED = """root => {
  let painted = 0;
  const walk = (node) => {
    if (node instanceof HTMLCanvasElement && node.width && node.height) {
      const { data } = node.getContext('2d').getImageData(0, 0, node.width, node.height);
      for (let i = 3; i < data.length; i += 4) painted += data[i] > 0;
    }
    for (const child of [...node.children, ...(node.shadowRoot?.children ?? [])]) walk(child);
  };
  walk(root);
  return painted;
}"""
# WCAG contrast of an element's text with the page behind it.
CONTRAST = """node => {
  const rgb = (text) => text.match(/[\\d.]+/g).map(Number);
  const light = ([r, g, b]) => [r, g, b].map((v) => v / 255)
    .map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4))
    .reduce((sum, v, i) => sum + v * [0.2126, 0.7152, 0.0722][i], 0);
  let behind = node;
  while (behind && (rgb(getComputedStyle(behind).backgroundColor)[3] ?? 1) === 0) {
    behind = behind.parentElement ?? behind.getRootNode().host;
  }
  const [a, b] = [light(rgb(getComputedStyle(node).color)),
                  behind ? light(rgb(getComputedStyle(behind).backgroundColor)) : 1];
  return (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
}"""


def open_page(page: Page, url: str) -> Page:
    """The page, once its explorables have started."""
    page.goto(url)
    page.evaluate(book.AT_REST)
    return page


@pytest.fixture(scope="module", params=PAGES)
def opened(request: pytest.FixtureRequest, window: Page, address: str) -> Iterator[Page]:
    """A page that is opened once, for all tests that leave it usable."""
    with book.lent(window) as page:
        yield open_page(page, address + request.param)


def explorables(page: Page) -> list[Locator]:
    found = page.locator(".inbounds-explorable").all()
    assert found
    return found


def readout(explorable: Locator) -> str:
    return explorable.locator("table").inner_text() + explorable.locator(".inbounds-note").inner_text()


def test_some_page_has_an_explorable() -> None:
    assert PAGES


def test_renders(opened: Page) -> None:
    for explorable in explorables(opened):
        assert explorable.get_attribute("data-state") == "live"
        assert explorable.evaluate(PAINTED) > 2000
        assert not explorable.locator(".inbounds-static").is_visible()
        assert all(cell.strip() for cell in explorable.locator("tbody td").all_inner_texts())
        assert len(explorable.locator(".inbounds-note").inner_text()) > 20


def test_answers_the_keyboard(opened: Page) -> None:
    for explorable in explorables(opened):
        handles = explorable.locator("[role=slider]").all()
        assert handles
        labels = [handle.get_attribute("aria-label") for handle in handles]
        assert all(labels)
        assert len(set(labels)) == len(labels)
        for handle in handles:
            handle.focus()
            before = readout(explorable), handle.get_attribute("aria-valuetext")
            at_the_left = handle.get_attribute("aria-valuenow") == handle.get_attribute("aria-valuemin")
            for _ in range(2):
                opened.keyboard.press("ArrowRight" if at_the_left else "ArrowLeft")
            after = readout(explorable), handle.get_attribute("aria-valuetext")
            assert before[0] != after[0]
            assert before[1] != after[1]
            shown = handle.evaluate(
                "node => node.getRootNode().querySelector('.bk-slider-value').textContent"
            )
            assert after[1] == shown


def test_goes_back_to_the_start_and_is_described_as_it_is(opened: Page) -> None:
    for explorable in explorables(opened):
        back = explorable.get_by_role("button", name="Back to the start")
        handles, picture = explorable.locator("[role=slider]").all(), explorable.locator("[role=img]").first
        if back.get_attribute("aria-disabled") == "false":
            back.click()  # what another test has moved
        first = readout(explorable)
        assert picture.get_attribute("aria-label") == explorable.get_attribute("data-alt")
        for handle in handles:
            handle.focus()
            at_the_left = handle.get_attribute("aria-valuenow") == handle.get_attribute("aria-valuemin")
            opened.keyboard.press("ArrowRight" if at_the_left else "ArrowLeft")
        assert readout(explorable) != first
        assert "sliders are now" in (picture.get_attribute("aria-label") or "")
        assert back.get_attribute("aria-disabled") == "false"
        back.click()
        assert readout(explorable) == first
        assert picture.get_attribute("aria-label") == explorable.get_attribute("data-alt")
        assert back.get_attribute("aria-disabled") == "true"


def test_sliders_are_reached_by_tab(opened: Page) -> None:
    focused = """() => {
      let node = document.activeElement;
      while (node?.shadowRoot?.activeElement) node = node.shadowRoot.activeElement;
      return node?.getAttribute('aria-label');
    }"""
    for explorable in explorables(opened):
        handles = explorable.locator("[role=slider]").all()
        handles[0].focus()
        for handle in handles[1:]:
            opened.keyboard.press("Tab")
            assert opened.evaluate(focused) == handle.get_attribute("aria-label")
        opened.keyboard.press("Tab")
        assert opened.evaluate(focused) not in [
            handle.get_attribute("aria-label") for handle in handles
        ]  # no trap


def test_follows_the_theme(opened: Page) -> None:
    """The reader presses the theme's own button; text stays readable and the canvas is painted anew."""
    button = opened.locator("button.theme-switch-button:visible").first
    pictures = {}
    for theme in ("light", "dark", "light"):
        for _ in range(3):  # the button goes round: system, light, dark
            if opened.locator("html").get_attribute("data-mode") == theme:
                break
            button.click()
        assert opened.locator("html").get_attribute("data-theme") == theme
        for number, explorable in enumerate(explorables(opened)):
            assert explorable.get_attribute("data-theme") == theme
            for text in ("thead th", "tbody th", "tbody td", ".inbounds-note", ".bk-slider-title"):
                assert explorable.locator(text).first.evaluate(CONTRAST) > 4.5, (theme, text)
            explorable.locator(".inbounds-note").scroll_into_view_if_needed()
            opened.wait_for_timeout(200)
            picture = explorable.locator(".inbounds-plot").screenshot()
            assert picture != pictures.get((number, "dark")), "still painted for the dark theme"
            pictures[number, theme] = picture


@pytest.mark.parametrize("name", PAGES)
def test_fits_a_phone(page: Page, address: str, name: str) -> None:
    page.set_viewport_size(book.PHONE)
    page.goto(address + name)
    page.evaluate(book.AT_REST)
    for explorable in explorables(page):
        box = explorable.bounding_box()
        assert box is not None
        assert box["x"] >= 0
        assert box["x"] + box["width"] <= book.PHONE["width"]
        assert explorable.evaluate("node => node.scrollWidth <= node.clientWidth")
        inner = explorable.locator(".inbounds-scroll")
        assert inner.evaluate("node => node.scrollWidth <= node.clientWidth + 1")


@pytest.mark.parametrize("name", PAGES)
@pytest.mark.parametrize("without", ["BokehJS", "JavaScript"])
def test_leaves_a_figure_where_it_cannot_run(
    context: BrowserContext, address: str, name: str, without: str
) -> None:
    browser = context.browser
    assert browser is not None
    bare = browser.new_context(java_script_enabled=without != "JavaScript")
    page = bare.new_page()
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    if without == "BokehJS":
        page.route(re.compile(r"/bokeh[^/]*\.js"), lambda route: route.abort())
    page.goto(address + name)
    if without == "BokehJS":
        page.evaluate(book.AT_REST)
    for explorable in explorables(page):
        image = explorable.locator(".inbounds-static img")
        assert image.is_visible()
        assert len(image.get_attribute("alt") or "") > 40
        assert not explorable.locator(".inbounds-live").is_visible()
    assert errors == []
    bare.close()


def test_prints_the_figure(opened: Page) -> None:
    opened.emulate_media(media="print")
    for explorable in explorables(opened):
        assert explorable.locator(".inbounds-static img").is_visible()
        assert not explorable.locator(".inbounds-live").is_visible()


def test_bounded_densities_shows_the_package_s_numbers(page: Page, address: str) -> None:
    """From the slider in the browser to the digits in the table, against the Python package."""
    names = book.pages('data-model="bounded-densities"')
    assert names
    for name in names:
        open_page(page, address + name)
        for explorable in page.locator("[data-model=bounded-densities]").all():
            mu, log_sigma = explorable.locator("[role=slider]").all()
            for handle, key, times in ((mu, "ArrowLeft", 13), (log_sigma, "ArrowRight", 12)):
                handle.focus()
                for _ in range(times):
                    page.keyboard.press(key)
            now = [float(handle.get_attribute("aria-valuenow") or "nan") for handle in (mu, log_sigma)]
            loc, scale = torch.tensor([now[0], math.exp(now[1])], dtype=torch.float64)
            law = LogitNormal(loc, scale, low=-1.0, high=1.0)
            cells = {
                row: explorable.locator(f"tr[data-row={row}] td").last.inner_text().replace("−", "-")
                for row in ("mean", "std", "median", "modes")
            }
            assert float(cells["mean"]) == pytest.approx(float(law.mean), abs=6e-4)
            assert float(cells["std"]) == pytest.approx(float(law.stddev), abs=6e-4)
            assert float(cells["median"]) == pytest.approx(float(law.median), abs=6e-4)
            modes = [float(mode) for mode in cells["modes"].split(" and ")]
            assert len(modes) == (2 if law.is_bimodal else 1)
            assert min(abs(mode - float(law.mode)) for mode in modes) < 6e-4


def test_live_outputs_start_and_load_bokeh_once(context: BrowserContext) -> None:
    """As JupyterLab shows them: HTML first, its scripts run afterwards; each output brings BokehJS, one is enough."""
    page = context.new_page()
    page.set_content("<!doctype html><html><head></head><body data-jp-theme-light='true'></body></html>")
    insert = """html => {
      const output = document.body.appendChild(document.createElement('div'));
      output.innerHTML = html;
      for (const script of output.querySelectorAll('script')) {
        const copy = document.createElement('script');
        for (const { name, value } of script.attributes) copy.setAttribute(name, value);
        copy.textContent = script.textContent;
        script.replaceWith(copy);
      }
    }"""
    for number in (1, 2):
        page.evaluate(insert, bounded_densities(mu=number / 2).html(live=True))
        page.wait_for_function("n => document.querySelectorAll('[data-state=live]').length === n", arg=number)
        assert page.locator("head script").count() == len(javascript_files())
    for explorable in explorables(page):
        assert explorable.evaluate(PAINTED) > 2000
        assert explorable.get_attribute("data-theme") == "light"
    page.evaluate("document.body.dataset.jpThemeLight = 'false'")
    page.wait_for_function("document.querySelectorAll('[data-state=live][data-theme=dark]').length === 2")
