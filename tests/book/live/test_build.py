"""`make book` puts the live robot into the book, and tries again where npm could not be reached."""

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


def test_what_failed_is_drawn_whole_the_next_time(built: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An unchanged page does not warn again: a second run would pass, and old pages would stay."""
    whole: list[bool] = []
    statuses = iter((0, 0, 1, 0, 0))

    def run(command: list[str], **options: Any) -> subprocess.CompletedProcess:
        whole.append("--all" in command)
        return subprocess.CompletedProcess(command, next(statuses))

    for name in ("INBOUNDS_BOOK_BUILD", "INBOUNDS_NB_CACHE"):
        monkeypatch.setenv(name, "")  # so that what the build sets is undone
    monkeypatch.setattr(build_book.notebook_cache, "fill", lambda code: built)
    monkeypatch.setattr(build_book.subprocess, "run", run)
    monkeypatch.setattr(build_book, "finish", lambda: "")
    monkeypatch.setitem(sys.modules, "student_copies", SimpleNamespace(write_downloads=lambda *folders: None))
    codes = []
    for _ in range(5):
        build_book.STAMP.unlink(missing_ok=True)
        codes.append(build_book.main())
    assert codes == [0, 0, 1, 0, 0]
    assert whole == [True, False, False, True, False]


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
