"""A built book on a loopback server, and a headless Chromium to read it with.

INBOUNDS_HTML names the folder of the built book (default `_build/html`), INBOUNDS_CHROMIUM the browser (default:
Chromium or Chrome on PATH).
"""

import functools
import http.server
import os
import shutil
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http import HTTPStatus
from pathlib import Path
from typing import Any

from playwright.sync_api import Browser, BrowserContext, Page, sync_playwright

HTML = Path(__file__).resolve().parents[2] / os.environ.get("INBOUNDS_HTML", "_build/html")
NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
ARGUMENTS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    # Whatever a page asks of another host fails at once, and is seen to fail.
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
]
SHIFT = """window.shift = 0; new PerformanceObserver((list) => {
  for (const entry of list.getEntries()) if (!entry.hadRecentInput) window.shift += entry.value;
}).observe({ type: 'layout-shift', buffered: true });"""
"""Adds up what moves while a page opens, in shares of the screen."""
STEADY = 0.05
"""More than this must not move."""
DESKTOP = {"width": 1280, "height": 900}
PHONE = {"width": 360, "height": 740}
WINDOWS = {"desktop": DESKTOP, "small-window": {"width": 1100, "height": 900}, "phone": PHONE}


def find_chromium() -> str:
    """Path of a Chromium; RuntimeError names the fix where there is none."""
    if chosen := os.environ.get("INBOUNDS_CHROMIUM"):
        if path := shutil.which(chosen):
            return path
        raise RuntimeError(
            f"INBOUNDS_CHROMIUM={chosen} is not a program: give the path of Chromium or Chrome"
        )
    for name in NAMES:
        if path := shutil.which(name):
            return path
    raise RuntimeError(
        "no Chromium on PATH: apt install chromium, or set INBOUNDS_CHROMIUM to the path of yours"
    )


def pages(containing: str = "") -> list[str]:
    """The book's pages, as paths below its folder, whose source contains a string."""
    found = [path for path in HTML.rglob("*.html") if "_static" not in path.parts]
    return sorted(
        path.relative_to(HTML).as_posix()
        for path in found
        if path != HTML / "index.html" and containing in path.read_text(encoding="utf-8")
    )


class _Quiet(http.server.SimpleHTTPRequestHandler):
    """Serves files without a line on stderr for each; whole files, so that a keep-alive connection is safe.

    What is not there is answered by the book's own 404.html, as the usual hosts of static pages do.
    """

    protocol_version = "HTTP/1.1"

    def log_message(self, format: str, *args: Any) -> None:
        pass

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
        page = Path(self.directory, "404.html")
        if code != HTTPStatus.NOT_FOUND or not page.exists():
            super().send_error(code, message, explain)
            return
        content = page.read_bytes()
        self.send_response(code)
        self.send_header("Content-Type", "text/html; charset=utf-8")
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(content)


@contextmanager
def served(folder: Path) -> Iterator[str]:
    """Serve a folder on a free port of the loopback interface; gives the base address, ending in a slash."""
    with http.server.ThreadingHTTPServer(
        ("127.0.0.1", 0), functools.partial(_Quiet, directory=str(folder))
    ) as server:
        server.daemon_threads = True
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_port}/"
        finally:
            server.shutdown()
            thread.join()


@contextmanager
def chromium() -> Iterator[Browser]:
    """A headless Chromium that shows scrollbars, as a desktop does; Playwright hides them unless told."""
    path = find_chromium()
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=path, headless=True, args=ARGUMENTS, ignore_default_args=["--hide-scrollbars"]
        )
        try:
            yield browser
        finally:
            browser.close()


def new_window(browser: Browser) -> Page:
    """A page that is lent to one reader after the other: a new one, with its process, takes longer than the book's."""
    context = browser.new_context(viewport=DESKTOP)
    context.set_default_timeout(20_000)
    return context.new_page()


@contextmanager
def lent(window: Page) -> Iterator[Page]:
    """Lend a page to a reader, who leaves nothing kept, routed or set; listeners are the reader's to remove."""
    try:
        yield window
    finally:
        window.unroute_all(behavior="ignoreErrors")
        window.evaluate("location.protocol === 'about:' || (localStorage.clear(), sessionStorage.clear())")
        window.context.clear_cookies()
        window.goto("about:blank")
        window.set_viewport_size(DESKTOP)
        window.emulate_media(media="null", color_scheme="null", reduced_motion="null", forced_colors="null")


def choose_theme(theme: str) -> str:
    """A script that makes a page of pydata-sphinx-theme open light or dark, as if the reader had chosen so before."""
    return f"localStorage.setItem('mode', '{theme}'); localStorage.setItem('theme', '{theme}');"


# A page loads what is far from its first screen when the reader comes near it; told so, it loads all of it at once.
EVERYTHING = "dispatchEvent(new Event('inbounds:everything'))"
# Resolves once the page has come to rest: fonts, MathJax, explorables, also those that nobody has come near.
AT_REST = (
    f"async () => {{ {EVERYTHING};"
    + """
  await document.fonts.ready;
  if (window.MathJax?.startup) await MathJax.startup.promise;
  const waiting = () => document.querySelector('.inbounds-explorable:is(:not([data-state]), [data-state=starting])');
  for (let i = 0; i < 100 && waiting(); i++) await new Promise((done) => setTimeout(done, 100));
}"""
)


def shift_of(context: BrowserContext, url: str, layer: str) -> float:
    """How much of a page moves while it opens, folds, logo, formulas, icons and films included.

    (A book that was built without npm sets its formulas later.) A busy machine paints before a style sheet has come,
    now and then: what is to blame moves at each of three times.
    """
    shifts: list[float] = []
    while len(shifts) < 3 and not any(shift <= STEADY for shift in shifts):
        page = context.new_page()
        page.route("**/mathjax/*.js", lambda route: route.abort())
        page.add_init_script(f"localStorage.setItem('inbounds-layer', '{layer}'); {SHIFT}")
        page.goto(url, wait_until="networkidle")
        page.evaluate(AT_REST)
        shifts.append(page.evaluate("window.shift"))
        page.close()
    return min(shifts)
