"""What a part of a cell says it ran on."""

import subprocess
from pathlib import Path

import pytest

import inbounds
from inbounds.study.running import provenance as module
from inbounds.study.running.provenance import commit, provenance


def test_the_commit_of_a_repository_in_which_the_package_merely_lies_is_not_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def git(*args: str) -> str:
        who = ("-c", "user.name=Test", "-c", "user.email=test@example.org")
        done = subprocess.run(
            ["git", "-C", str(tmp_path), *who, *args], capture_output=True, text=True, check=True
        )
        return done.stdout.strip()

    package = tmp_path / "environment" / "inbounds"
    (package / "learning").mkdir(parents=True)
    (package / "__init__.py").touch()
    monkeypatch.setattr(inbounds, "__file__", str(package / "__init__.py"))
    asked = commit.__wrapped__  # without its memory
    assert asked() == "unknown"  # no repository
    git("init")
    git("commit", "--allow-empty", "-m", "Somebody's project")
    assert asked() == "unknown"
    git("add", "environment")
    git("commit", "-m", "The package's own")
    assert asked() == git("rev-parse", "HEAD")
    (package / "learning" / "new.py").touch()
    assert asked() == git("rev-parse", "HEAD") + "+"


def test_what_is_asked_often_is_read_once_and_is_the_caller_s(monkeypatch: pytest.MonkeyPatch) -> None:
    first = provenance()
    monkeypatch.setattr(module, "versions", lambda: pytest.fail("read again"))
    first["versions"].clear()
    assert provenance()["versions"]["torch"]
