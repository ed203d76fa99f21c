"""The study's explorer in the built book: it answers every control, speaks, fits a phone, leaves a figure."""

import json
import re

import pytest
from playwright.sync_api import BrowserContext, Locator, Page

from inbounds.book.report import as_they_come, study_pages
from inbounds.study.analysis import Contrast
from tests.pages import browser as book

NAME = "notebooks/what_happened.html"
SAID, ROWS = ".explorer-said", ".explorer-row .told"
CHOICES = {"start": 4, "algorithm": 2, "endpoint": 2, "family": 4, "robot": 6}


def opened(page: Page, address: str, name: str = NAME) -> Locator:
    page.goto(address + name)
    page.evaluate(book.AT_REST)
    explorer = page.locator(".inbounds-study-explorer")
    page.wait_for_selector(".inbounds-study-explorer[data-state=live] .explorer-panels svg")
    return explorer


def test_shows_the_static_page_s_words(page: Page, address: str) -> None:
    """From the built book's data through the script to the screen, against Python."""
    explorer = opened(page, address)
    rows = as_they_come.compared(study_pages.shipped(), "standard")
    for start, algorithm, endpoint in (("standard", "ppo", "final"), ("standard", "trpo", "area")):
        for value in (start, algorithm, endpoint):
            explorer.locator(f"input[value={value}]").check()
        said = explorer.locator(SAID).inner_text()
        for law in ("beta", "logit-normal") if algorithm == "ppo" else ("logit-normal",):
            contrast = Contrast("standard", algorithm, law, "gaussian")
            assert as_they_come.told(as_they_come.of(rows, contrast=contrast, endpoint=endpoint)) in said


def test_every_control_changes_what_is_shown(page: Page, address: str) -> None:
    explorer = opened(page, address)
    data = json.loads(explorer.locator("script[type='application/json']").inner_text())
    for name, count in CHOICES.items():
        controls = explorer.locator(f"input[name={name}]").all()
        assert len(controls) == count
        for control in controls:
            before = explorer.locator(".explorer-live").inner_html()
            if name in ("family", "robot"):
                control.click()
            elif not control.is_checked():
                control.check()
            else:
                continue
            assert explorer.locator(".explorer-live").inner_html() != before
            if name in ("family", "robot"):
                control.click()
    shown = set(explorer.locator(ROWS).all_inner_texts())
    written = {row["told"] for rows in data["rows"].values() for row in rows}
    assert shown
    assert shown <= written


def test_answers_the_keyboard_and_speaks(page: Page, address: str) -> None:
    explorer = opened(page, address)
    said = explorer.locator(SAID)
    assert said.get_attribute("aria-live") == "polite"
    explorer.locator("input[value=standard]").focus()
    stops = []
    for _ in range(3 + 4 + 6):
        stops.append(page.evaluate("document.activeElement.name"))
        page.keyboard.press("Tab")
    assert stops == ["start", "algorithm", "endpoint", *["family"] * 4, *["robot"] * 6]
    assert page.evaluate("document.activeElement.closest('.explorer-live')") is None  # no trap
    explorer.locator("input[value=standard]").focus()
    before = said.inner_text()
    page.keyboard.press("ArrowLeft")
    assert "equally quiet" in said.inner_text() != before
    explorer.locator("input[value=Ant]").focus()
    before = said.inner_text()
    page.keyboard.press("Space")
    assert said.inner_text() != before
    for svg in explorer.locator("svg").all():
        label = svg.get_attribute("aria-label") or ""
        assert svg.get_attribute("aria-hidden") == "true" or len(label) > 30


def test_a_view_has_an_address(page: Page, address: str) -> None:
    explorer = opened(page, address)
    for value in ("equal", "trpo", "area", "Ant"):
        explorer.locator(f"input[value={value}]").click()
    explorer.locator("input[value=gaussian]").uncheck()
    chosen = explorer.locator("input:checked").evaluate_all("all => all.map((each) => each.value)")
    live = explorer.locator(".explorer-live").inner_html()
    explorer.get_by_text("Link to this view").click()
    sent = page.url
    page.goto("about:blank")
    page.goto(sent)
    page.wait_for_selector(".inbounds-study-explorer[data-state=live] .explorer-panels svg")
    assert explorer.locator("input:checked").evaluate_all("all => all.map((each) => each.value)") == chosen
    assert explorer.locator(".explorer-live").inner_html() == live
    assert explorer.bounding_box()["y"] < page.viewport_size["height"]
    page.goto(f"{address}{NAME}#study?start=nowhere&robot=Hopper")  # the same page: nothing is loaded
    assert explorer.locator("input:checked").evaluate_all("all => all.map((each) => each.value)") == [
        *chosen[:3],
        "Hopper",
    ]


def test_what_is_missing_is_one_strip(page: Page, address: str) -> None:
    explorer = opened(page, address)
    assert not explorer.locator(".explorer-missing").is_visible()  # usual starts, PPO: nothing lacks
    explorer.locator("input[value=printed]").check()
    strip = explorer.locator(".explorer-missing").inner_text()
    assert re.match(r"\d+ of \d+ differences are there\. Not finished: .*Ant", strip)


def test_chapter_16_moves_between_quiet_as_they_come_and_loud(page: Page, address: str) -> None:
    """It begins with its own robots and policies; each start changes sentence, forest and curves together."""
    explorer = opened(page, address, "notebooks/why.html")
    ticked = explorer.locator("input:checked").evaluate_all("nodes => nodes.map((node) => node.value)")
    assert set(ticked) == {
        "standard",
        "trpo",
        "final",
        *("gaussian", "clipped-gaussian", "logit-normal"),
        *("HalfCheetah", "Ant"),
    }
    seen = set()
    for start, words in (
        ("equal", "equally quiet"),
        ("standard", "from the usual starts"),
        ("loud", "equally loud"),
    ):
        explorer.locator(f"input[value={start}]").check()
        said = explorer.locator(SAID).inner_text()
        assert words in said
        assert "Logit-normal − Gaussian: " in said
        assert explorer.locator(ROWS).count() >= 2
        assert explorer.locator(".explorer-panels svg[role=img]").count() == 2
        seen.add((said, explorer.locator(".explorer-panels").inner_text()))
    assert len(seen) == 3
    assert "Logit-normal, loud" in explorer.locator(".explorer-panels").inner_text()


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_fits_a_phone_in_both_themes(context: BrowserContext, address: str, theme: str) -> None:
    context.add_init_script(book.choose_theme(theme))
    page = context.new_page()
    page.set_viewport_size(book.PHONE)
    page.goto(address + NAME)
    page.wait_for_selector(".inbounds-study-explorer[data-state=live] .explorer-panels svg")
    explorer = page.locator(".inbounds-study-explorer")
    assert explorer.evaluate("node => node.scrollWidth <= node.clientWidth")
    right = explorer.evaluate(
        "node => Math.max(...[...node.querySelectorAll('.explorer-live *')]"
        ".map((each) => each.getBoundingClientRect().right))"
    )
    assert right <= book.PHONE["width"]
    assert (
        explorer.evaluate("node => getComputedStyle(node).color")
        == {
            "light": "rgb(34, 39, 45)",
            "dark": "rgb(206, 214, 221)",
        }[theme]
    )


@pytest.mark.parametrize("without", ["JavaScript", "a screen"])
def test_leaves_a_figure_where_it_cannot_run(context: BrowserContext, address: str, without: str) -> None:
    assert context.browser is not None
    bare = context.browser.new_context(java_script_enabled=without != "JavaScript")
    page = bare.new_page()
    page.goto(address + NAME)
    if without == "a screen":
        page.wait_for_selector(".inbounds-study-explorer[data-state=live] .explorer-panels svg")
        page.emulate_media(media="print")
    image = page.locator(".inbounds-study-explorer .explorer-static img")
    assert image.is_visible()
    assert len(image.get_attribute("alt") or "") > 40
    assert not page.locator(".inbounds-study-explorer .explorer-live").is_visible()
    bare.close()


def test_works_from_a_file(context: BrowserContext) -> None:
    page = context.new_page()
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.goto((book.HTML / NAME).as_uri())
    page.wait_for_selector(".inbounds-study-explorer[data-state=live] .explorer-panels svg")
    assert all(url.startswith(("file:", "data:", "blob:")) for url in asked)
