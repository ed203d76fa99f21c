"""`make lighthouse` says which page is below the bar, and what to do where it cannot measure."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from inbounds.book.npm import node
from tools import lighthouse

FAST = {"score": 90, "seen": 1.5, "largest": 2.25, "blocked": 0.1, "shift": 0.01, "kilobytes": 400.0}


@pytest.mark.parametrize(
    ("second", "status", "said"),
    [
        ({}, 0, "All reach 70."),
        ({"score": 69}, 1, "below 70, or moves more than 0.05: b.html"),
        ({"shift": 0.06}, 1, "below 70, or moves more than 0.05: b.html"),
    ],
)
def test_the_verdict(
    second: dict[str, float],
    status: int,
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture,
) -> None:
    for name in ("a.html", "b.html"):
        (tmp_path / name).touch()
    monkeypatch.setenv("INBOUNDS_CHROMIUM", sys.executable)
    monkeypatch.setattr(lighthouse, "measure", lambda *_: {"a.html": FAST, "b.html": FAST | second})
    monkeypatch.setattr(sys, "argv", ["lighthouse", "--html", str(tmp_path), "a.html", "b.html"])
    assert lighthouse.main() == status
    lines = capsys.readouterr().out.splitlines()
    assert lines[-1] == said
    assert lines[1].split() == ["a.html", "90", "1.5", "2.25", "0.1", "0.01", "400"]


def test_what_is_missing_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    monkeypatch.setattr(sys, "argv", ["lighthouse", "--html", str(tmp_path), "a.html"])
    assert lighthouse.main() == 1
    assert "run `make book` first" in capsys.readouterr().err
    (tmp_path / "a.html").touch()
    monkeypatch.setenv("INBOUNDS_CHROMIUM", "no-such-browser")
    assert lighthouse.main() == 1
    assert "INBOUNDS_CHROMIUM=no-such-browser is not a program" in capsys.readouterr().err


def test_the_script_is_javascript() -> None:
    subprocess.run([node(), "--check", lighthouse.HERE / "measure.mjs"], check=True)


def test_every_package_has_a_checksum_and_none_a_host() -> None:
    lock = json.loads((lighthouse.HERE / "package-lock.json").read_text(encoding="utf8"))
    packages = {name: each for name, each in lock["packages"].items() if name}
    assert len(packages) > 50
    assert all("integrity" in each and "resolved" not in each for each in packages.values())
