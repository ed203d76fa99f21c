"""Pick your own seeds in the built book: what is ticked changes what is said; it fits a phone, and speaks."""

import itertools

import numpy as np
import pytest
from playwright.sync_api import BrowserContext, Locator, Page

from inbounds.book import verdicts
from inbounds.book.explorer.picked_seeds import pairs, reports
from inbounds.book.report import study_pages
from inbounds.study.words import percent
from tests.pages import browser as book

NAME = "notebooks/how_to_compare_ten_seeds.html"
LIVE = ".inbounds-picked-seeds[data-state=live] .seeds-plot svg"
SAID = ".seeds-said"


def opened(page: Page, address: str) -> Locator:
    page.goto(address + NAME)
    page.evaluate(book.AT_REST)
    page.wait_for_selector(LIVE)
    return page.locator(".inbounds-picked-seeds")


def test_says_what_python_says_of_the_ticked_seeds(page: Page, address: str) -> None:
    seeds = opened(page, address)
    row, sides = next(
        (row, sides)
        for row, sides in pairs(study_pages.shipped())
        if row.contrast[:] == ("standard", "ppo", "beta", "gaussian") and row.robot == "Walker2d"
    )
    seeds.locator("select[name=robot]").select_option("Walker2d")
    seeds.locator("select[name=pair]").select_option("beta,gaussian")
    boxes = [seeds.locator(f"input[name=side-{side}]").all() for side in (0, 1)]
    picked = ((1, 4, 6, 9), (0, 2, 7))
    for side, ticked in zip(boxes, picked, strict=True):
        for i, box in enumerate(side):
            box.set_checked(i in ticked)
    every = reports(*sides, (4, 3))
    place = tuple(list(itertools.combinations(range(10), len(ticked))).index(ticked) for ticked in picked)
    mine = tuple(float(each[place]) for each in (every.low, every.value, every.high))
    said = seeds.locator(SAID).inner_text()
    assert verdicts.told(mine).partition("]")[0] in said
    assert verdicts.verdict(mine, unit=" points") in said
    assert "n = 4 and 3" in said
    assert verdicts.told(row.difference).partition("]")[0] in said
    assert "25\u202f200 ways" in seeds.locator("caption").inner_text()  # 210 times 120
    for shown, (rule, shares) in zip(seeds.locator("tbody tr").all(), every.shares().items(), strict=True):
        cells = shown.locator("td").all_inner_texts()
        for cell, share in zip(cells, (shares["higher"], shares["nothing"], shares["lower"]), strict=True):
            fewest = 1 if 0 < share < 0.1 else 0
            told = "–" if rule == "means" and cell == "–" else percent(share, fewest)
            assert cell == ("under 0.1\u202f%" if 0 < share < 0.001 else told)


def test_every_button_and_choice_changes_what_is_said(page: Page, address: str) -> None:
    seeds = opened(page, address)
    said = seeds.locator(SAID)
    for name in ("Best for the first", "Best for the second", "All", "Three at random"):
        before = said.inner_text()
        seeds.get_by_role("button", name=name, exact=True).click()
        assert said.inner_text() != before
    for name in ("pair", "robot", "algorithm"):
        before = said.inner_text()
        seeds.locator(f"select[name={name}]").select_option(index=1)
        assert said.inner_text() != before
    for box in seeds.locator("input[name=side-0]").all():
        box.uncheck()
    assert "at least two" in said.inner_text()
    assert not seeds.locator("table").is_visible()


def test_answers_the_keyboard_and_speaks(page: Page, address: str) -> None:
    seeds = opened(page, address)
    said = seeds.locator(SAID)
    assert said.get_attribute("aria-live") == "polite"
    seeds.locator("select[name=robot]").focus()
    stops = []
    for _ in range(3 + 20 + 4):
        stops.append(page.evaluate("document.activeElement.name || document.activeElement.textContent"))
        page.keyboard.press("Tab")
    assert stops[:3] == ["robot", "algorithm", "pair"]
    assert stops[3:23] == ["side-0"] * 10 + ["side-1"] * 10
    assert len(set(stops[23:])) == 4
    assert page.evaluate("document.activeElement.closest('.seeds-live')") is None  # no trap
    seeds.locator("input[name=side-1]").nth(8).focus()
    before = said.inner_text()
    page.keyboard.press("Space")
    assert "n = 3 and 4" in said.inner_text() != before
    label = seeds.locator("svg[role=img]").get_attribute("aria-label") or ""
    assert label.count("ticked") == 7
    assert label.count("seed ") == 20


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_fits_a_phone_in_both_themes(context: BrowserContext, address: str, theme: str) -> None:
    context.add_init_script(book.choose_theme(theme))
    page = context.new_page()
    page.set_viewport_size(book.PHONE)
    page.goto(address + NAME)
    page.wait_for_selector(LIVE)
    right = page.locator(".inbounds-picked-seeds").evaluate(
        "node => Math.max(...[...node.querySelectorAll('.seeds-live *')]"
        ".map((each) => each.getBoundingClientRect().right))"
    )
    assert right <= book.PHONE["width"]
    color = page.locator(".inbounds-picked-seeds").evaluate("node => getComputedStyle(node).color")
    assert (np.mean([int(x) for x in color[4:-1].split(",")]) > 128) == (theme == "dark")


@pytest.mark.parametrize("without", ["JavaScript", "a screen"])
def test_leaves_a_figure_where_it_cannot_run(context: BrowserContext, address: str, without: str) -> None:
    assert context.browser is not None
    bare = context.browser.new_context(java_script_enabled=without != "JavaScript")
    page = bare.new_page()
    page.goto(address + NAME)
    if without == "a screen":
        page.wait_for_selector(LIVE)
        page.emulate_media(media="print")
    image = page.locator(".inbounds-picked-seeds .seeds-static img")
    assert image.is_visible()
    assert len(image.get_attribute("alt") or "") > 40
    assert not page.locator(".inbounds-picked-seeds .seeds-live").is_visible()
    bare.close()
