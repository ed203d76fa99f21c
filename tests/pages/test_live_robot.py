"""The live robot in the built book: it starts when asked, answers its controls, rests off screen, and leaves the films.

Chromium draws WebGL in software here, and a phone is an emulated viewport with touch.
"""

import io
from collections.abc import Callable, Iterator

import pytest
from PIL import Image
from playwright.sync_api import Browser, BrowserContext, Locator, Page

from tests.pages import browser as book
from tests.pages.test_accessibility import AXE, serious

PAGES = book.pages('class="inbounds-live-robot"')
PAGE = "notebooks/live_robot.html"  # where all of it is tried; the other pages start theirs
STATUS = book.HTML / "_static" / "live" / "status.js"
WEBGL = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader")
READY = """() => {
  const robot = document.querySelector('.inbounds-live-robot');
  return robot.dataset.state === 'live' || robot.querySelector('.inbounds-live-why').textContent.includes('could not');
}"""


def films_only() -> str:
    """Why the book was built without the robots, or nothing."""
    text = STATUS.read_text(encoding="utf8") if STATUS.is_file() else "no status.js"
    return text if '"why"' in text or "no status" in text else ""


needs_robots = pytest.mark.skipif(bool(films_only()), reason=f"the book has films only: {films_only()}")


@pytest.fixture(scope="module")
def webgl(browser: Browser) -> Iterator[Browser]:
    """A Chromium that draws WebGL in software."""
    running = browser.browser_type.launch(
        executable_path=book.find_chromium(),
        headless=True,
        args=[*book.ARGUMENTS, *WEBGL],
        ignore_default_args=["--hide-scrollbars"],
    )
    yield running
    running.close()


@pytest.fixture
def reader(webgl: Browser) -> Iterator[BrowserContext]:
    context = webgl.new_context(viewport=book.DESKTOP)
    context.set_default_timeout(30_000)
    yield context
    context.close()


def start(context: BrowserContext, url: str) -> Page:
    """A page whose first live robot runs, with its errors and what it asked for in `seen`."""
    page = context.new_page()
    page.seen = []  # type: ignore[attr-defined]
    page.on("pageerror", lambda error: page.seen.append(str(error)))  # type: ignore[attr-defined]
    page.on("request", lambda request: page.seen.append(request.url) if outside(request.url, url) else None)  # type: ignore[attr-defined]
    page.goto(url)
    page.locator(".inbounds-live-ask button").first.click()
    page.wait_for_function(READY)
    assert robot(page).get_attribute("data-state") == "live", robot(page).inner_text()
    return page


def outside(asked: str, url: str) -> bool:
    return not asked.startswith((url.split("notebooks/")[0], "data:", "blob:"))


def colours(canvas: Locator, enough: int = 20) -> int:
    """How many colours a picture on the page has: a WebGL canvas itself has forgotten what it drew.

    A busy machine takes its time to draw, so a picture with too few is taken again.
    """
    count = 0
    for _ in range(20):
        picture = Image.open(io.BytesIO(canvas.screenshot())).convert("RGB")
        count = len(picture.getcolors(picture.width * picture.height) or [])
        if count > enough:
            break
        canvas.page.wait_for_timeout(500)
    return count


def robot(page: Page) -> Locator:
    return page.locator(".inbounds-live-robot").first


def reading(page: Page, row: str, side: int = 0) -> float:
    text = robot(page).locator("table").nth(side).locator("tr", has_text=row).locator("td").inner_text()
    return float(text.split()[0].replace("−", "-"))


def test_some_page_has_a_live_robot() -> None:
    assert PAGE in PAGES


@needs_robots
@pytest.mark.parametrize(("name", "way"), [*((name, "served") for name in PAGES), (PAGE, "file")])
def test_it_runs(reader: BrowserContext, address: str, name: str, way: str) -> None:
    page = start(reader, f"{address if way == 'served' else book.HTML.as_uri() + '/'}{name}")
    page.wait_for_function(
        "() => parseFloat(document.querySelectorAll('.inbounds-live-robot td')[2].textContent) > 0.3"
    )
    assert page.seen == []  # type: ignore[attr-defined]
    for canvas in robot(page).locator("canvas").all():
        assert colours(canvas) > 20
    assert not robot(page).locator(".inbounds-live-film").is_visible()


@needs_robots
def test_it_answers_its_controls(reader: BrowserContext, address: str) -> None:
    page = start(reader, address + PAGE)
    place = robot(page)
    place.get_by_role("button", name="Pause").click()
    place.get_by_role("button", name="Same start again").click()
    page.wait_for_function(
        "() => document.querySelectorAll('.inbounds-live-robot td')[2].textContent === '0.00 s'"
    )
    place.get_by_role("button", name="One step").click()
    page.wait_for_function(
        "() => document.querySelectorAll('.inbounds-live-robot td')[2].textContent !== '0.00 s'"
    )
    assert reading(page, "Time", 0) == reading(page, "Time", 1)  # one clock
    # snapped to the bounds: every action is at one
    first = place.locator(".inbounds-live-one").first
    first.get_by_label("acts by").select_option("sample-snapped")
    place.get_by_role("button", name="Same start again").click()
    for _ in range(3):
        place.get_by_role("button", name="One step").click()
    page.wait_for_timeout(300)
    assert reading(page, "Actions at a bound") == 100
    # no noise: a second run from the same start is the same run
    returns = []
    first.get_by_label("acts by").select_option("sample")
    first.get_by_label("noise ×").fill("0")
    for _ in range(2):
        place.get_by_role("button", name="Same start again").click()
        for _ in range(4):
            place.get_by_role("button", name="One step").click()
        page.wait_for_timeout(300)
        returns.append(reading(page, "Return"))
    assert returns[0] == returns[1]
    assert "return" in place.locator("[aria-live]").inner_text()


@needs_robots
@pytest.mark.parametrize("choice", ["Hopper", "Swimmer", "Walker2d", "Ant", "Humanoid"])
def test_every_robot_can_be_chosen(reader: BrowserContext, address: str, choice: str) -> None:
    page = start(reader, address + PAGE)
    robot(page).get_by_label("Robot", exact=True).select_option(choice)
    page.wait_for_function(
        f"() => document.querySelector('.inbounds-live-view').ariaLabel.startsWith('{choice}')"
    )
    page.wait_for_function(
        "() => parseFloat(document.querySelectorAll('.inbounds-live-robot td')[2].textContent) > 0.1"
    )
    assert page.evaluate("document.documentElement.scrollWidth <= document.documentElement.clientWidth")
    assert page.seen == []  # type: ignore[attr-defined]
    assert colours(robot(page).locator(".inbounds-live-view canvas").first) > 20


@needs_robots
def test_a_push_moves_it(reader: BrowserContext, address: str) -> None:
    """Two runs of the same robot from the same start, one of them pushed."""
    page = start(reader, address + PAGE)
    place = robot(page)
    place.get_by_role("button", name="Pause").click()
    view = place.locator(".inbounds-live-view").first
    pushes: dict[str, Callable[[], None]] = {
        "none": lambda: None,
        "by a key": lambda: view.press("ArrowRight"),
        "by a click on its left": lambda: view.click(position={"x": 20, "y": 60}),
    }
    speeds = {}
    for name, push in pushes.items():
        place.get_by_role("button", name="Same start again").click()
        push()
        for _ in range(4):
            place.get_by_role("button", name="One step").click()
        page.wait_for_timeout(300)
        speeds[name] = reading(page, "Speed")
    assert speeds["by a key"] > speeds["none"] + 0.3
    assert speeds["by a click on its left"] == speeds["by a key"]


@needs_robots
def test_what_cannot_be_loaded_is_said_and_another_choice_goes_on(
    reader: BrowserContext, address: str
) -> None:
    page = start(reader, address + PAGE)
    place = robot(page)
    page.route("**/policies/walker2d-*.js", lambda route: route.abort())
    place.get_by_label("Robot", exact=True).select_option("Walker2d")
    page.wait_for_function(
        "() => document.querySelector('.inbounds-live-robot [aria-live]').textContent.includes('could not be loaded')"
    )
    place.get_by_role("button", name="Pause").click()
    for name in ("Play", "One step", "Same start again"):
        place.get_by_role("button", name=name).click()
    place.get_by_label("Robot", exact=True).select_option("Hopper")
    page.wait_for_function(
        "() => document.querySelector('.inbounds-live-view').ariaLabel.startsWith('Hopper')"
    )
    time = "document.querySelectorAll('.inbounds-live-robot td')[2].textContent"
    page.wait_for_function(f"() => {time} === '0.00 s'")
    assert "could not" not in place.locator("[aria-live]").inner_text()
    place.get_by_role("button", name="One step").click()
    page.wait_for_function(f"() => {time} !== '0.00 s'")
    assert page.seen == []  # type: ignore[attr-defined]


@needs_robots
def test_a_failed_start_can_be_tried_again_and_the_keyboard_stays(
    reader: BrowserContext, address: str
) -> None:
    page = reader.new_page()
    page.add_init_script(
        "const start = WebAssembly.instantiate;"
        "WebAssembly.instantiate = async () => { WebAssembly.instantiate = start; throw new Error('once'); };"
    )
    page.goto(address + PAGE)
    ask = robot(page).locator(".inbounds-live-ask button")
    ask.press("Enter")
    page.wait_for_function(READY)
    assert "could not be started" in robot(page).locator(".inbounds-live-why").inner_text()
    ask.press("Enter")
    page.wait_for_function("() => document.querySelector('.inbounds-live-robot').dataset.state === 'live'")
    assert page.evaluate("document.activeElement.textContent") == "Pause"


@needs_robots
def test_another_noise_is_drawn_while_it_waits(reader: BrowserContext, address: str) -> None:
    page = start(reader, address + PAGE)
    first = robot(page).locator(".inbounds-live-one").first
    robot(page).get_by_role("button", name="Pause").click()
    page.wait_for_timeout(300)
    drawn = "document.querySelector('.inbounds-live-one canvas[role=img]').toDataURL()"
    before = page.evaluate(drawn)
    first.get_by_label("noise ×").fill("0.3")
    page.wait_for_function(f"before => {drawn} !== before", arg=before)


@needs_robots
def test_it_rests_off_screen(reader: BrowserContext, address: str) -> None:
    page = start(reader, address + PAGE)
    page.evaluate("document.querySelector('.inbounds-live-robot').style.marginTop = '4000px'; scrollTo(0, 0)")
    page.wait_for_timeout(800)
    before = reading(page, "Time")
    page.wait_for_timeout(800)
    assert reading(page, "Time") == before


@needs_robots
def test_it_waits_where_motion_is_unwelcome(webgl: Browser, address: str) -> None:
    context = webgl.new_context(reduced_motion="reduce")
    page = start(context, address + PAGE)
    page.wait_for_timeout(500)
    assert reading(page, "Time") == 0
    said = robot(page).locator("[aria-live]")
    assert "reduced motion" in said.inner_text()
    assert said.get_attribute("aria-live") == "polite"
    robot(page).get_by_role("button", name="Play").click()
    page.wait_for_function(
        "() => parseFloat(document.querySelectorAll('.inbounds-live-robot td')[2].textContent) > 0"
    )
    page.wait_for_function(
        "() => document.querySelector('.inbounds-live-says').textContent.includes('return')"
    )
    assert said.get_attribute("aria-live") == "off"  # what changes every few seconds interrupts nobody
    robot(page).get_by_role("button", name="One step").click()
    assert said.get_attribute("aria-live") == "polite"
    context.close()


@needs_robots
def test_it_fits_a_phone(webgl: Browser, address: str) -> None:
    context = webgl.new_context(viewport=book.PHONE, has_touch=True, is_mobile=True)
    page = start(context, address + PAGE)
    assert page.evaluate("document.documentElement.scrollWidth <= document.documentElement.clientWidth")
    for control in robot(page).locator("select, button:visible, input").all():
        box = control.bounding_box()
        assert box is not None
        assert box["x"] >= 0
        assert box["x"] + box["width"] <= book.PHONE["width"]
    context.new_cdp_session(page).send("Emulation.setCPUThrottlingRate", {"rate": 4})
    before = reading(page, "Time")
    page.wait_for_function(
        f"() => parseFloat(document.querySelectorAll('.inbounds-live-robot td')[2].textContent) > {before + 0.5}"
    )
    context.close()


@pytest.mark.parametrize("lack", ["WebAssembly", "DecompressionStream", "WebGL 2"])
def test_the_films_stay_where_it_cannot_run(context: BrowserContext, address: str, lack: str) -> None:
    page = context.new_page()
    if lack == "WebGL 2":
        page.add_init_script(
            "const get = HTMLCanvasElement.prototype.getContext;"
            "HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {"
            " return kind.startsWith('webgl') ? null : get.call(this, kind, ...rest); }"
        )
    else:
        page.add_init_script(f"delete globalThis.{lack}")
    page.goto(address + PAGE)
    place = robot(page)
    assert place.locator("video").first.is_visible()
    assert not place.locator(".inbounds-live-ask button").is_visible()
    assert (lack if not films_only() else "npm") in place.locator(".inbounds-live-why").inner_text()


@pytest.mark.parametrize("name", PAGES)
def test_nothing_of_it_weighs_on_a_page_before_it_is_asked_for(
    context: BrowserContext, address: str, name: str
) -> None:
    page = context.new_page()
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.goto(address + name, wait_until="networkidle")
    ours = sorted(url.split("/live/")[1].split("?")[0] for url in asked if "/live/" in url)
    assert ours == ["boot.js", "status.js"]


@needs_robots
def test_its_controls_are_accessible(reader: BrowserContext, address: str) -> None:
    page = start(reader, address + PAGE)
    robot(page).get_by_role("button", name="Pause").click()
    page.evaluate(AXE)
    assert serious(page, "light") == []
    assert serious(page, "dark") == []
