"""`make book` puts the live robot into the book, and tries again where npm could not be reached."""

from pathlib import Path

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
