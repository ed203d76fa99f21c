"""`make book` puts the live robot into the book, and tries again where npm could not be reached."""

import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from inbounds.book.live import site
from tools import build_book


@pytest.fixture
def built(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A built book that is up to date, but for the live robot."""
    html = tmp_path / "html"
    html.mkdir()
    for name, path in (
        ("INDEX", html / "index.html"),
        ("STAMP", tmp_path / "stamp"),
        ("DRAWN_BY", tmp_path / "drawn-by"),
        ("LIVE", tmp_path / "live"),
    ):
        monkeypatch.setattr(build_book, name, path)
    monkeypatch.setattr(build_book, "digest", lambda *names: "same")
    monkeypatch.setattr(build_book.notebook_cache, "ROOT", tmp_path)  # where it is held while it is built
    monkeypatch.setattr("sys.argv", ["build_book.py"])
    build_book.INDEX.write_text("the book", encoding="utf8")
    build_book.STAMP.write_text("same same without npm", encoding="utf8")
    return tmp_path


def pretend(monkeypatch: pytest.MonkeyPatch, why: str) -> list[Path]:
    """Let the site be written with this outcome; return the folders it was written to."""
    asked: list[Path] = []

    def write(target: Path) -> str:
        asked.append(target)
        target.mkdir(exist_ok=True)
        (target / "boot.js").write_text(why, encoding="utf8")
        return why

    monkeypatch.setattr(site, "write", write)
    return asked


def test_without_npm_the_book_has_films_and_the_next_run_tries_again(
    built: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    asked = pretend(monkeypatch, "npm could not bring the packages")
    for times in (1, 2):
        assert build_book.main() == 0
        assert len(asked) == times
        assert "films only. npm could not bring the packages" in capsys.readouterr().out
    pretend(monkeypatch, "")
    assert build_book.main() == 0
    assert (built / "html" / "_static" / "live" / "boot.js").read_text(encoding="utf8") == ""
    assert build_book.STAMP.read_text(encoding="utf8") == "same same"


def test_a_book_with_its_robot_asks_nobody(
    built: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    build_book.STAMP.write_text("same same", encoding="utf8")
    asked = pretend(monkeypatch, "")
    assert build_book.main() == 0
    assert asked == []
    assert "The book is up to date." in capsys.readouterr().out


def draw_nothing(built: Path, monkeypatch: pytest.MonkeyPatch, *statuses: int) -> list[bool]:
    """Let Jupyter Book return these statuses, and draw nothing; return which of its runs were to draw every page."""
    whole: list[bool] = []
    left = iter(statuses)

    def run(command: list[str], **options: Any) -> subprocess.CompletedProcess:
        whole.append("--all" in command)
        return subprocess.CompletedProcess(command, next(left))

    for name in ("INBOUNDS_BOOK_BUILD", "INBOUNDS_NB_CACHE"):
        monkeypatch.setenv(name, "")  # so that what the build sets is undone
    monkeypatch.setattr(build_book.notebook_cache, "fill", lambda code: built)
    monkeypatch.setattr(build_book.subprocess, "run", run)
    monkeypatch.setattr(build_book, "finish", lambda: "")
    monkeypatch.setitem(sys.modules, "student_copies", SimpleNamespace(write_downloads=lambda *folders: None))
    return whole


def test_what_failed_is_drawn_whole_the_next_time(built: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An unchanged page does not warn again: a second run would pass, and old pages would stay."""
    whole = draw_nothing(built, monkeypatch, 0, 0, 1, 0, 0)
    codes = []
    for _ in range(5):
        build_book.STAMP.unlink(missing_ok=True)
        codes.append(build_book.main())
    assert codes == [0, 0, 1, 0, 0]
    assert whole == [True, False, False, True, False]


def test_a_title_that_is_edited_during_a_build_is_drawn_by_the_next(
    built: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    draw_nothing(built, monkeypatch, 0)
    build_book.STAMP.unlink()
    titles = ["as it was"]
    monkeypatch.setattr(build_book, "drawn_by", lambda: titles[0])
    monkeypatch.setattr(build_book.notebook_cache, "fill", lambda code: titles.insert(0, "edited") or built)
    assert build_book.main() == 0
    assert build_book.DRAWN_BY.read_text() == "as it was"


def test_a_file_of_the_results_that_a_page_hands_out_is_looked_at() -> None:
    """The digest that notebooks run again by has none of the prose."""
    looked_at = {*build_book.PAGES, *build_book.CODE}
    for folder, pattern in (("notebooks", "*.ipynb"), ("book", "*.md")):
        for page in (build_book.ROOT / folder).glob(pattern):
            for name in re.findall(r"\.\./((?:results|benchmarks)/[\w./-]+\.(?:md|svg))", page.read_text()):
                assert name in looked_at, page.name


def test_a_new_title_is_drawn_on_every_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "book").mkdir()
    page = tmp_path / "book" / "a.md"
    monkeypatch.setattr(build_book, "ROOT", tmp_path)
    monkeypatch.setattr(build_book, "digest", lambda *names: "same")
    said = []
    for text in ("# One\n\ntext", "# One\n\nother text", "# Two\n\nother text"):
        page.write_text(text, encoding="utf8")
        said.append(build_book.drawn_by())
    assert said[0] == said[1] != said[2]
