"""The thesis's claims in the built book: buttons and menu choose, by keyboard too; all is there without them."""

import json
from collections import Counter

import pytest
from playwright.sync_api import BrowserContext, Locator, Page

from inbounds.book.explorer.claims import FEW, MARKS
from tests.pages import browser as book

NAME = "notebooks/claim_by_claim.html"
LISTS = ".inbounds-claims"
VERDICTS = "nodes => nodes.filter((node) => node.checkVisibility()).map((node) => node.dataset.verdict)"


def opened(page: Page, url: str) -> Locator:
    page.goto(url)
    page.evaluate(book.AT_REST)
    first = page.locator(LISTS).first
    page.wait_for_selector(f"{LISTS}[data-state=live]")
    return first


def shown(claims: Locator) -> list[str]:
    found: list[str] = claims.locator("details").evaluate_all(VERDICTS)
    return found


def button(claims: Locator, verdict: str) -> Locator:
    return claims.locator(f'button[data-verdict="{verdict}"]')


@pytest.mark.parametrize("scheme", ["http", "file"])
def test_buttons_choose_by_verdict(context: BrowserContext, address: str, scheme: str) -> None:
    start = address if scheme == "http" else f"{book.HTML.as_uri()}/"
    claims = opened(context.new_page(), start + NAME)
    everything = shown(claims)
    counts = Counter(everything)
    assert len(everything) > FEW
    assert set(counts) <= set(MARKS)
    said = claims.get_by_role("status")
    assert said.inner_text() == f"{len(everything)} of {len(everything)} claims."
    for verdict, count in counts.items():
        one = button(claims, verdict)
        assert one.inner_text().endswith(f" {count}")
        one.click()
        assert one.get_attribute("aria-pressed") == "true"
        assert button(claims, "").get_attribute("aria-pressed") == "false"
        assert shown(claims) == [verdict] * count
        assert said.inner_text() == f"{count} of {len(everything)} claims: {verdict}."
        one.click()
        assert one.get_attribute("aria-pressed") == "false"
        assert button(claims, "").get_attribute("aria-pressed") == "true"
        assert shown(claims) == everything
    first, second = list(counts)[:2]
    button(claims, first).click()
    button(claims, second).click()
    assert Counter(shown(claims)) == {first: counts[first], second: counts[second]}
    button(claims, "").click()
    assert shown(claims) == everything


def test_the_menu_chooses_by_subject(page: Page, address: str) -> None:
    claims = opened(page, address + NAME)
    everything = len(shown(claims))
    menu = claims.locator("select")
    subjects = menu.locator("option").all_inner_texts()[1:]
    total = 0
    for subject in subjects:
        menu.select_option(subject)
        assert claims.locator("h3:visible").all_inner_texts() == [subject]
        here = Counter(shown(claims))
        assert button(claims, "").inner_text().endswith(f" {here.total()}")
        for verdict in MARKS:
            assert button(claims, verdict).inner_text().endswith(f" {here[verdict]}")
        assert (
            claims.get_by_role("status").inner_text() == f"{here.total()} of {everything} claims: {subject}."
        )
        total += here.total()
    assert total == everything


def test_a_choice_that_nothing_answers_to_has_a_way_out(page: Page, address: str) -> None:
    claims = opened(page, address + NAME)
    everything = shown(claims)
    way_out = claims.get_by_role("button", name="Show all")
    assert not way_out.is_visible()
    menu = claims.locator("select")
    for subject in menu.locator("option").all_inner_texts()[1:]:
        menu.select_option(subject)
        missing = next((word for word in MARKS if word not in shown(claims)), None)
        if missing:
            break
    assert missing, "every subject has every verdict: nothing to try"
    button(claims, missing).click()
    assert shown(claims) == []
    way_out.click()
    assert shown(claims) == everything
    assert not way_out.is_visible()


def test_answers_the_keyboard_and_speaks(page: Page, address: str) -> None:
    claims = opened(page, address + NAME)
    assert claims.get_by_role("status").get_attribute("aria-live") == "polite"
    button(claims, "").focus()
    stops = []
    for _ in range(1 + len(MARKS)):
        stops.append(page.evaluate("document.activeElement.dataset.verdict"))
        page.keyboard.press("Tab")
    assert stops == ["", *MARKS]
    assert page.evaluate("document.activeElement.localName") == "select"
    button(claims, "refuted").focus()
    for key in ("Space", "Enter"):
        before = shown(claims)
        page.keyboard.press(key)
        assert shown(claims) != before
        assert page.evaluate("document.activeElement.dataset.verdict") == "refuted"
    line = claims.locator("details").first
    line.locator("summary").focus()
    page.keyboard.press("Enter")
    assert line.locator("blockquote").is_visible()


def test_a_link_to_a_claim_opens_it(page: Page, address: str) -> None:
    claims = opened(page, address + NAME)
    button(claims, "supported").click()
    hidden = claims.locator('details[data-verdict="undecided"]').last
    name = hidden.get_attribute("id")
    assert not hidden.is_visible()
    page.evaluate(f"location.hash = {json.dumps(name)}")
    hidden.locator("ul").wait_for(state="visible")
    assert hidden.evaluate("node => node.getBoundingClientRect().top") < book.DESKTOP["height"]


@pytest.mark.parametrize("without", ["JavaScript", "a screen"])
def test_all_is_there_where_nothing_can_be_chosen(
    context: BrowserContext, address: str, without: str
) -> None:
    assert context.browser is not None
    bare = context.browser.new_context(java_script_enabled=without != "JavaScript")
    page = bare.new_page()
    page.goto(address + NAME)
    claims = page.locator(LISTS).first
    lines = claims.locator("details").count()
    if without == "a screen":
        page.wait_for_selector(f"{LISTS}[data-state=live]")
        button(claims, "refuted").click()
        assert len(shown(claims)) < lines
        page.emulate_media(media="print")
    assert len(shown(claims)) == lines
    assert claims.locator("h3:visible").count() == claims.locator("h3").count()
    assert not claims.locator(".claims-choice").is_visible()
    assert claims.locator(".claim-verdict").first.is_visible()
    bare.close()


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_fits_a_phone_and_says_each_verdict_in_a_word(
    context: BrowserContext, address: str, theme: str
) -> None:
    context.add_init_script(book.choose_theme(theme))
    page = context.new_page()
    claims = opened(page, address + NAME)
    page.set_viewport_size(book.PHONE)
    right = claims.evaluate(
        "node => Math.max(...[...node.querySelectorAll('*')].map((each) => each.getBoundingClientRect().right))"
    )
    assert right <= book.PHONE["width"]
    for line in claims.locator("details").all():
        badge = line.locator(".claim-verdict")
        word = line.get_attribute("data-verdict") or ""
        assert badge.inner_text() == f"{MARKS[word]} {word.capitalize()}"
    looks = claims.locator(".claim-verdict").evaluate_all(
        "nodes => nodes.map((node) => [node.dataset.verdict, getComputedStyle(node).color])"
    )
    assert len({color for _, color in looks}) >= 3
