"""Videos in the built book play when the reader asks, and end."""

import pytest
from playwright.sync_api import BrowserContext

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


@pytest.mark.parametrize("name", PAGES)
def test_videos_play(context: BrowserContext, address: str, name: str) -> None:
    page = context.new_page()
    page.goto(address + name)
    for video in page.locator("video").all():
        assert video.evaluate("node => node.paused && node.currentTime === 0"), "it started by itself"
        video.scroll_into_view_if_needed()
        played = video.evaluate(PLAY)
        assert played["error"] is None
        assert played["time"] >= 0.2
        assert played["width"] > 0
        assert played["duration"] <= 5.05


@pytest.mark.parametrize("name", PAGES)
def test_videos_stop_at_their_end(context: BrowserContext, address: str, name: str) -> None:
    page = context.new_page()
    page.goto(address + name)
    video = page.locator("video").first
    video.evaluate("node => { node.muted = true; node.playbackRate = 8; return node.play(); }")
    video.evaluate("node => node.ended || new Promise((done) => node.addEventListener('ended', done))")
    assert video.evaluate("node => node.paused || node.ended")
