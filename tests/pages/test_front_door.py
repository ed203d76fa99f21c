"""The front page moves, says who wins and where that is shown, and leads four kinds of readers on."""

import pytest
from playwright.sync_api import Page

FRONT = "notebooks/front_page.html"
FILMS = "[...document.querySelectorAll('.inbounds-loop video')]"
PLAYING = f"{FILMS}.length === 2 && {FILMS}.every((film) => !film.paused && film.currentTime > 0.1)"
TOGETHER = f"Math.abs({FILMS}[0].currentTime - {FILMS}[1].currentTime) < 0.1"
PAUSED = f"{FILMS}.every((film) => film.paused)"
CARDS = {
    "I want to learn": "notebooks/actions_have_bounds.html",
    "I want to use it": "notebooks/which_policy.html",
    "I teach": "book/teaching.html",
    "I doubt it": "notebooks/claim_by_claim.html",
}


@pytest.fixture
def front(page: Page, address: str) -> Page:
    """The front page, its films in view."""
    page.goto(address + FRONT)
    page.locator(".inbounds-loop").scroll_into_view_if_needed()
    return page


def test_films_loop_on_one_clock(front: Page) -> None:
    front.wait_for_function(PLAYING)
    front.evaluate(f"{FILMS}[1].currentTime += 0.6")
    front.wait_for_function(TOGETHER)
    front.evaluate(f"{FILMS}.forEach((film) => {{ film.currentTime = film.duration - 0.3; }})")
    front.wait_for_function(
        f"{FILMS}.every((film) => film.currentTime < film.duration - 0.5 && !film.paused)"
    )


def test_they_go_on_when_both_end_in_the_same_moment(front: Page) -> None:
    """The second one's pause is then told after both have begun again."""
    for _ in range(4):
        front.wait_for_function(PLAYING)
        front.evaluate(f"{FILMS}.forEach((film) => {{ film.currentTime = film.duration - 0.05; }})")
        front.wait_for_function(
            f"{FILMS}.every((film) => film.currentTime < film.duration - 0.5 && !film.paused)"
        )


def test_one_pause_stops_both_for_good(front: Page) -> None:
    front.wait_for_function(PLAYING)
    front.evaluate(f"{FILMS}[0].pause()")
    front.wait_for_function(PAUSED)
    front.mouse.wheel(0, 5000)
    front.wait_for_timeout(300)
    front.mouse.wheel(0, -5000)
    front.wait_for_timeout(300)
    assert front.evaluate(PAUSED)


def test_out_of_sight_they_rest(front: Page) -> None:
    front.set_viewport_size({"width": 1280, "height": 300})
    front.locator(".inbounds-loop").scroll_into_view_if_needed()
    front.wait_for_function(PLAYING)
    front.locator("footer").first.scroll_into_view_if_needed()
    front.wait_for_function(PAUSED)
    front.locator(".inbounds-loop").scroll_into_view_if_needed()
    front.wait_for_function(PLAYING)


BAND = f"getComputedStyle({FILMS}[0]).backgroundColor"


def test_the_dark_band_is_there_with_the_controls_only(front: Page) -> None:
    front.wait_for_function(PLAYING)
    none = "rgba(0, 0, 0, 0)"
    assert front.evaluate(BAND) == none
    front.locator(".inbounds-loop video").first.hover()
    assert front.evaluate(BAND) != none
    front.mouse.move(0, 0)
    assert front.evaluate(BAND) == none
    front.evaluate(f"{FILMS}[0].pause()")
    front.wait_for_function(PAUSED)
    front.wait_for_function(f"{BAND} !== '{none}'")


def test_who_wants_less_motion_sees_them_still(page: Page, address: str) -> None:
    page.emulate_media(reduced_motion="reduce")
    page.goto(address + FRONT)
    page.locator(".inbounds-loop").scroll_into_view_if_needed()
    page.wait_for_timeout(1000)
    assert page.evaluate(f"{PAUSED} && {FILMS}.every((film) => film.currentTime === 0 && film.controls)")


def test_every_field_says_who_wins_and_leads_to_its_evidence(front: Page) -> None:
    fields = front.locator("table.winners tbody td")
    assert fields.count() == 6 * 2
    assert fields.locator("a").count() == fields.count()
    for text in fields.all_inner_texts():
        assert any(word in text for word in ("above", "below", "no difference found", "not run")), text
    table = front.locator("table.winners")
    algorithms = table.locator("thead th").all_inner_texts()
    leads = {
        (row.locator("th").inner_text(), algorithm): row.locator("a").nth(i).evaluate("node => node.href")
        for row in table.locator("tbody tr").all()
        for i, algorithm in enumerate(algorithms)
    }
    for (robot, algorithm), url in leads.items():
        front.goto(url)
        row = front.locator(":target")
        assert row.inner_text().startswith(robot)
        assert row.locator("xpath=ancestor::table/caption").inner_text().startswith(f"{algorithm}, minus")
        assert 0 <= row.evaluate("node => node.getBoundingClientRect().top") < 900


def test_four_cards_lead_on(front: Page, address: str) -> None:
    cards = front.locator(".sd-card")
    assert cards.count() == len(CARDS)
    for title, target in CARDS.items():
        link = cards.filter(has_text=title).locator("a")
        assert link.evaluate("node => node.href") == address + target


def test_it_says_how_to_cite(front: Page) -> None:
    entry = front.locator("#how-to-cite .highlight").text_content() or ""
    assert entry.lstrip().startswith("@software{")
    assert "In Bounds" in entry
