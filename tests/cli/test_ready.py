"""The first cell of a student's copy: one line where all is there, a remedy where something is not."""

from collections.abc import Callable

import pytest

from inbounds.cli.classroom import ready
from inbounds.cli.classroom.doctor import Diagnosis


def test_all_is_there(capsys: pytest.CaptureFixture[str]) -> None:
    ready.ready()
    said = capsys.readouterr().out
    assert said.count("\n") == 1
    for name in ("Python 3.", "packages ", "packages (book) ", "results "):
        assert name in said


def says(state: str, name: str) -> Callable[..., Diagnosis]:
    return lambda *_: Diagnosis(name, state, "torch is not there", "see the README")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("look", "state", "name"),
    [
        ("look_at_python", "missing", "Python"),
        ("look_at_packages", "missing", "packages"),
        ("look_at_packages", "optional", "packages (book)"),
    ],
)
def test_what_no_notebook_runs_without_stops_it(monkeypatch, look: str, state: str, name: str) -> None:
    monkeypatch.setattr(ready, look, says(state, name))
    with pytest.raises(RuntimeError, match="torch is not there") as told:
        ready.ready()
    assert ready.INSTALL in str(told.value)


def test_without_results_most_chapters_run(monkeypatch, capsys, tmp_path) -> None:
    monkeypatch.setattr(ready, "ROOT", tmp_path)
    ready.ready()
    assert "results not there: Part IV reads them" in capsys.readouterr().out
