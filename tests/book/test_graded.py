"""An exercise says that it is graded where, and only where, one of its chapter's graders is called below it."""

import importlib
import inspect
import json
import re
import sys
from pathlib import Path

import pytest

from inbounds.book.exercises.judging import Judgement
from inbounds.book.pages.graded import graders_in, graders_of

ROOT = Path(__file__).resolve().parents[2]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
GRADERS = sorted(
    path
    for path in (ROOT / "src/inbounds/book/exercises").glob("*.py")
    if path.stem not in ("__init__", "judging")
)


@pytest.fixture(scope="module")
def graded():
    sys.path.insert(0, str(ROOT / "book" / "_ext"))
    try:
        yield importlib.import_module("graded")
    finally:
        sys.path.pop(0)


def registry(chapter: str) -> set[str]:
    """The graders of a chapter: public functions that return a judgement."""
    module = importlib.import_module(f"inbounds.book.exercises.{chapter}")
    return {
        name
        for name, each in vars(module).items()
        if inspect.isfunction(each)
        and not name.startswith(("_", "judge"))
        and each.__annotations__.get("return") in (Judgement, "Judgement")
    }


@pytest.mark.parametrize("path", GRADERS, ids=lambda path: path.stem)
def test_every_grader_of_the_registry_marks_an_exercise(path: Path) -> None:
    notebook = ROOT / "notebooks" / path.name.replace(".py", ".ipynb")
    called = {name for names in graders_of(notebook).values() for name in names}
    assert called
    assert called <= registry(path.stem)
    elsewhere = {
        name
        for each in (notebook, *(ROOT / "tools" / "build").glob("*.ipynb"))
        for cell in json.loads(each.read_text(encoding="utf8"))["cells"]
        for name in graders_in("".join(cell["source"]))
    }  # a grader may also stand in *Build it*, or in a build notebook
    assert registry(path.stem) <= called | elsewhere


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_every_exercise_has_a_label(notebook: Path) -> None:
    cells = json.loads(notebook.read_text(encoding="utf8"))["cells"]
    prose = "\n\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "markdown")
    found = graders_of(notebook)
    assert len(found) == len(re.findall(r"\{exercise-start\}", prose))
    assert not any(found.values()) or f"exercises import {notebook.stem} as graders" in notebook.read_text(
        "utf8"
    )


def test_the_mark_stands_in_the_title_of_that_exercise_alone(graded) -> None:
    body = "".join(
        f'<div class="exercise admonition" id="{label}">\n<p class="admonition-title"><span>1</span> (x)</p></div>'
        for label in ("ex-a", "ex-b")
    )
    told = graded.marked(body, ["ex-b"])
    assert told.count(graded.MARK) == 1
    assert told.endswith(f"(x){graded.MARK}</p></div>")
    with pytest.raises(ValueError, match="ex-c has a grader"):
        graded.marked(body, ["ex-c"])
