"""Six pages in Firefox: no complaint, nothing asked of others, nothing too wide, and all that can be touched answers.

Chromium reads every page. What is tried here is what differs between browsers: scripts, WebGL, WebAssembly, layout.
INBOUNDS_FIREFOX names the browser (default: Firefox on PATH). `firefox/read.mjs` drives it, by WebDriver BiDi.
A headless Firefox has no WebGL without a graphics card: then the live robot has to say so. With INBOUNDS_WINDOW=1,
on a screen or by `xvfb-run`, it has to run.
"""

import json
import os
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from inbounds.book.npm import CACHE, made_once, node

HERE = Path(__file__).parent / "firefox"
# What each page has that answers a touch.
PAGES = {
    "notebooks/front_page.html": (),
    "notebooks/live_robot.html": ("robot",),
    "notebooks/ppo.html": ("explorable", "guess", "layers"),
    "notebooks/how_to_compare_ten_seeds.html": ("guess", "seeds", "layers"),
    "notebooks/what_happened.html": ("guess", "explorer", "layers"),
    "search.html?q=KL+invariance": ("search",),
}
HALF_A_FORMULA = re.compile(r"Invalid markup: Incorrect number of children for <\w+/> tag")
"""Firefox says so, too, of a formula whose rest has not arrived yet; `test_formulas.py` counts the children."""


def find_firefox() -> str:
    """Path of a Firefox; RuntimeError names the fix where there is none."""
    for name in (os.environ.get("INBOUNDS_FIREFOX"), "firefox-esr", "firefox"):
        if name and (path := shutil.which(name)):
            return path
    raise RuntimeError(
        "no Firefox on PATH: apt install firefox-esr, or set INBOUNDS_FIREFOX to the path of yours"
    )


def _installed(folder: Path, made: Path) -> None:
    for name in ("node_modules", "read.mjs"):
        (folder / name).rename(made / name)


@pytest.fixture(scope="module")
def seen(address: str) -> dict[str, Any]:
    """What was seen on each page."""
    inputs = [HERE / name for name in ("package.json", "package-lock.json", "read.mjs")]
    script = made_once(CACHE / "firefox", inputs, _installed) / "read.mjs"
    done = subprocess.run(
        [node(), script, find_firefox(), address, *PAGES],
        capture_output=True,
        text=True,
        check=False,
        timeout=600,
    )
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


@pytest.mark.parametrize("name", PAGES)
def test_a_page_is_quiet_and_fits(seen: dict[str, Any], name: str) -> None:
    assert [said for said in seen[name]["complaints"] if not HALF_A_FORMULA.search(said)] == []
    assert seen[name]["outside"] == []
    assert seen[name]["wide"] == {"1280": 0, "360": 0}


@pytest.mark.parametrize("name", PAGES)
def test_what_can_be_touched_answers(seen: dict[str, Any], name: str) -> None:
    touched = seen[name]["touched"]
    assert set(touched) == set(PAGES[name])
    for what, said in touched.items():
        if what == "search":
            assert "KL invariance" in said["after"][1]
        elif what == "robot" and "WebGL 2" in said["before"][0]:
            assert said["before"][0].endswith("the film stays.")
        else:
            assert said["before"] != said["after"], what


def test_a_closed_book_opens_in_code_mode(seen: dict[str, Any]) -> None:
    layers = seen["notebooks/ppo.html"]["touched"]["layers"]
    assert layers["after"] > layers["before"]
