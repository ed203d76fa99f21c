"""Videos in the built book play when the reader asks, and end."""

import io
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Browser, Locator, Page

from inbounds.book.drawing import videos
from inbounds.robots import Film
from tests.pages import browser as book

PAGES = book.pages("<video")
PLAY = """async video => {
  video.muted = true;
  await video.play();
  for (let i = 0; i < 100 && video.currentTime < 0.2; i++) await new Promise((done) => setTimeout(done, 50));
  return { time: video.currentTime, duration: video.duration, error: video.error?.message ?? null,
           width: video.videoWidth };
}"""


def test_some_page_has_a_video() -> None:
    assert PAGES


@pytest.fixture(scope="module", params=PAGES)
def opened(request: pytest.FixtureRequest, window: Page, address: str) -> Iterator[Page]:
    """A page with films, opened once."""
    with book.lent(window) as page:
        page.emulate_media(reduced_motion="reduce")  # else those of the front page begin by themselves
        page.goto(address + request.param)
        yield page


def test_videos_play(opened: Page) -> None:
    for video in opened.locator("video").all():
        assert video.evaluate("node => node.paused && node.currentTime === 0"), "it started by itself"
        video.scroll_into_view_if_needed()
        played = video.evaluate(PLAY)
        assert played["error"] is None
        assert played["time"] >= 0.2
        assert played["width"] > 0
        assert played["duration"] <= 5.05


def test_videos_stop_at_their_end(opened: Page) -> None:
    video = opened.locator("video").first
    video.evaluate("node => { node.muted = true; node.playbackRate = 8; return node.play(); }")
    video.evaluate("node => node.ended || new Promise((done) => node.addEventListener('ended', done))")
    assert video.evaluate("node => node.paused || node.ended")


def test_two_films_fit_a_phone_and_play_to_their_end(browser: Browser, tmp_path: Path) -> None:
    film = Film(np.full((25, 240, 320, 3), 60, np.uint8), 25.0, 0.0)  # one second
    row = videos.show_films({"One": film, "Two": film})
    head = '<!doctype html><meta name="viewport" content="width=device-width">'
    (tmp_path / "index.html").write_text(f"{head}<body>{row._repr_html_()}", encoding="utf8")
    with book.served(tmp_path) as address:
        page = browser.new_page(viewport={"width": 320, "height": 640})
        page.goto(address + "index.html")
        page.wait_for_function("[...document.querySelectorAll('video')].every(v => v.readyState >= 1)")
        assert page.evaluate("document.documentElement.scrollWidth") <= 320
        start = page.evaluate("[...document.querySelectorAll('video')].map(v => [v.paused, v.currentTime])")
        assert start == [[True, 0], [True, 0]]
        assert page.evaluate("document.querySelector('video').duration") == pytest.approx(1.0, abs=0.05)
        page.evaluate("document.querySelector('video').play()")
        page.wait_for_function("document.querySelector('video').ended", timeout=10_000)
        page.close()


def test_controls_do_not_cover_the_picture(browser: Browser, tmp_path: Path) -> None:
    """Before it is played and when it is paused again, with and without scripts, its lower third is free."""
    film = Film(np.full((50, 240, 320, 3), (40, 160, 90), np.uint8), 25.0, 0.0)
    row = videos.show_films({"One": film, "Two": film})
    (tmp_path / "index.html").write_text(f"<!doctype html><body>{row._repr_html_()}", encoding="utf8")

    def worst_and_band(video: Locator) -> tuple[int, int]:
        """How far the lower third is from the film's colour, and the brightest of what is below the picture."""
        for _ in range(100):  # while it loads, Chromium draws a ring on the poster
            pixels = np.asarray(Image.open(io.BytesIO(video.screenshot())).convert("RGB")).astype(int)
            worst = int(np.abs(pixels[160:232, 4:-4] - (40, 160, 90)).max())
            if worst < 30:
                break
            video.page.wait_for_timeout(100)
        return worst, int(pixels[240:].max())

    with book.served(tmp_path) as address:
        for scripts in (True, False):
            context = browser.new_context(java_script_enabled=scripts)
            page = context.new_page()
            page.goto(address + "index.html")
            video = page.locator("video").first
            worst, band = worst_and_band(video)
            assert worst < 30
            assert band > 200, "no controls in the band"
            if scripts:
                video.evaluate("node => node.play()")
                page.wait_for_function("document.querySelector('video').currentTime > 0.2")
                video.evaluate("node => node.pause()")
                assert worst_and_band(video)[0] < 30
            page.keyboard.press("Tab")
            assert video.evaluate("node => node === document.activeElement"), "a keyboard does not reach it"
            context.close()
