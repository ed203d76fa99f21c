"""Notebooks with blanks: unanswered they run through, and the program's own functions fill every blank."""

import re
from pathlib import Path
from typing import Any

import nbformat
import pytest

from inbounds.book.exercises.judging import Judgement
from inbounds.book.pages import programs
from inbounds.cli.classroom.grading import graders_shown
from tools import student_copies

FOLDER = Path(student_copies.ROOT) / "tools" / "build"
WHOLE = {"ppo", "trpo"}
"""In these a class writes a whole program: `test_programs_from_blanks.py`."""
NOTEBOOKS = sorted(path for path in FOLDER.glob("*.ipynb") if path.stem not in WHOLE)
STUB = re.compile(r"^def (\w+)\(.*return \.\.\.\s*$", re.S)


def code_of(path: Path) -> list[str]:
    return [cell.source for cell in nbformat.read(path, as_version=4).cells if cell.cell_type == "code"]


def played(path: Path, monkeypatch: pytest.MonkeyPatch, answered: bool) -> tuple[list[Judgement], int]:
    """What the graders say, and how often `train` was called, with the blanks left or filled."""
    namespace: dict[str, Any] = {"__name__": "__main__"}
    judged, trained = [], []
    for source in code_of(path):
        if stub := STUB.search(source):
            own = namespace[stub[1]]
            exec(source, namespace)
            if answered:
                namespace[stub[1]] = own
            continue
        if re.fullmatch(r"[\w.]+\(\w+\)", source):
            judged.append(eval(source, namespace))
            continue
        exec(source, namespace)
        if "programs.start" in source:
            namespace["train"] = lambda *_, **__: trained.append(1)
    return judged, len(trained)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_unanswered_it_runs_through(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    judged, trained = played(path, monkeypatch, answered=False)
    assert judged
    assert all(judgement.passed is None for judgement in judged)
    assert trained == 0


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_the_program_s_functions_fill_the_blanks(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    judged, trained = played(path, monkeypatch, answered=True)
    blanks = [source for source in code_of(path) if STUB.search(source)]
    assert len(judged) == len(blanks) == trained
    assert all(judgement.passed for judgement in judged)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_grader_follows_each_blank(path: Path) -> None:
    sources = code_of(path)
    for number, source in enumerate(sources):
        if stub := STUB.search(source):
            assert f"({stub[1]})" in sources[number + 1]
            assert '"""' in source


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.ipynb")), ids=lambda path: path.stem)
def test_a_class_s_table_has_a_row_for_each_judgement(path: Path) -> None:
    judged = [source for source in code_of(path) if re.fullmatch(r"[\w.]+\(\w+\)", source)]
    assert judged
    assert list(graders_shown(path).values()) == [source.partition("(")[0].split(".")[1] for source in judged]


def test_they_are_handed_out() -> None:
    copies = student_copies.chapters_in_order()
    assert {f"build_{path.name}" for path in NOTEBOOKS} <= set(copies)
    assert NOTEBOOKS
    for path in NOTEBOOKS:
        assert "programs.start(globals()" in "\n".join(code_of(path))
        assert programs.has_program(student_copies.ROOT / "notebooks" / "many_steps_from_one_batch.ipynb")
        assert student_copies.written(path)
