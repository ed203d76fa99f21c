"""Student copies have no solutions, lack nothing else, run, and never overwrite a student's work."""

import ast
import copy
import importlib.util
import json
from pathlib import Path
from types import ModuleType

import nbformat
import pytest
from nbclient import NotebookClient
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook

from inbounds.cli.classroom import ready
from tools.notebook_hook import defined

ROOT = Path(__file__).resolve().parents[2]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))


def load_tool() -> ModuleType:
    spec = importlib.util.spec_from_file_location("student_copies", ROOT / "tools/student_copies.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


tool = load_tool()


def tagged(cell: nbformat.NotebookNode) -> bool:
    return "solution" in cell.metadata.get("tags", [])


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda p: p.stem)
def test_a_chapters_copy_has_no_solution_and_lacks_nothing_else(path: Path) -> None:
    chapter = nbformat.read(path, as_version=4)
    before = copy.deepcopy(chapter)
    student = tool.student_copy(chapter)
    assert chapter == before
    nbformat.validate(student)

    prose = "\n".join(cell.source for cell in student.cells if cell.cell_type == "markdown")
    assert "solution-start" not in prose
    assert "solution-end" not in prose
    whole = "\n".join(cell.source for cell in chapter.cells if cell.cell_type == "markdown")
    assert whole.count("```{solution-start}") == prose.count(tool.INSTEAD)
    for part in ("{exercise-start}", "{exercise-end}", "\n## ", "{admonition}"):
        assert prose.count(part) == whole.count(part)

    code = [cell for cell in student.cells if cell.cell_type == "code"]
    assert all(cell.outputs == [] and cell.execution_count is None for cell in code)
    sources = {cell.id: cell.source for cell in chapter.cells}
    assert code[0] is student.cells[0]
    assert code[0].id == "ready" not in sources
    assert all(cell.source == sources[cell.id] for cell in code[1:])
    left_out = [cell for cell in chapter.cells if cell.id not in {kept.id for kept in student.cells}]
    assert all(tagged(cell) or between_markers(chapter, cell) for cell in left_out)
    assert not any(tagged(cell) for cell in student.cells)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda p: p.stem)
def test_a_copy_shows_every_number(path: Path) -> None:
    """JupyterLab shows a glue role as an error, and no student can predict from it or read an answer."""
    prose = "\n".join(
        cell.source
        for cell in tool.student_copy(nbformat.read(path, as_version=4)).cells
        if cell.cell_type == "markdown"
    )
    assert "{glue" not in prose


def test_numbers_are_written_as_the_book_writes_them() -> None:
    values = {"": {"half": "0.5", "told": "'3 [1, 5], above'", "odd": "np.float64(2.5)"}}
    text = "{glue:text}`half:.0%` of {glue:text}`told`; {glue:text}`odd`, {glue:text}`nowhere:.2f`"
    assert (
        tool.with_numbers(text, values) == "50% of 3 [1, 5], above; np.float64(2.5), {glue:text}`nowhere:.2f`"
    )
    assert (
        tool.with_numbers("a\n\n```{glue} films\n```\n\nb", values) == "a\n\n*A later cell shows this.*\n\nb"
    )


def between_markers(chapter: nbformat.NotebookNode, cell: nbformat.NotebookNode) -> bool:
    """Whether more solutions begin than end before the end of this cell, or it holds nothing but a marker."""
    before = [c.source for c in chapter.cells[: chapter.cells.index(cell) + 1] if c.cell_type == "markdown"]
    text = "\n".join(before)
    balance = text.count("```{solution-start}") - text.count("```{solution-end}")
    return balance == 1 or "```{solution-end}" in cell.source


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda p: p.stem)
def test_what_is_left_needs_nothing_from_a_solution(path: Path) -> None:
    """Otherwise *Run All* on a student copy would end in a NameError."""
    chapter = nbformat.read(path, as_version=4)
    left = {cell.id for cell in tool.student_copy(chapter).cells}
    code = [cell for cell in chapter.cells if cell.cell_type == "code"]
    kept = [ast.parse(cell.source) for cell in code if cell.id in left]
    only_in_solutions = set().union(*(defined(ast.parse(c.source)) for c in code if c.id not in left))
    only_in_solutions -= set().union(*map(defined, kept))
    used = {node.id for tree in kept for node in ast.walk(tree) if isinstance(node, ast.Name)}
    assert used & only_in_solutions == set()


def exercise() -> nbformat.NotebookNode:
    """A chapter of one exercise; its markers share their cells with other text, as they do in the book."""
    solution = new_code_cell("def mass_outside(*arguments):\n    return 0.5", metadata={"tags": ["solution"]})
    grader = "from inbounds.book.exercises import actions_have_bounds as graders\ngraders.mass_outside(mass_outside)"
    return new_notebook(
        cells=[
            new_markdown_cell(
                "# A chapter\n\n```{exercise-start} Mass\n:label: ex\n```\n\nWrite it.\n\n```{exercise-end}\n```"
            ),
            new_code_cell("def mass_outside(loc, scale, low, high):\n    return ..."),
            new_markdown_cell("Before.\n\n```{solution-start} ex\n:class: dropdown\n```\n\nA secret."),
            solution,
            new_markdown_cell("Another secret.\n\n```{solution-end}\n```\n\nAfter."),
            new_code_cell(grader, execution_count=3),
        ]
    )


def last_output(notebook: nbformat.NotebookNode) -> str:
    NotebookClient(notebook, timeout=120).execute()
    return notebook.cells[-1].outputs[0].data["text/plain"]


@pytest.mark.slow
def test_a_copy_runs_in_any_folder(tmp_path: Path) -> None:
    student = tool.student_copy(exercise())
    NotebookClient(student, timeout=120, resources={"metadata": {"path": str(tmp_path)}}).execute()
    assert student.cells[0].source.splitlines()[0].endswith(ready.INSTALL)
    assert student.cells[0].outputs[0].text.startswith("Ready: Python 3.")


@pytest.mark.slow
def test_run_all_grades_the_students_own_code() -> None:
    student = tool.student_copy(exercise())
    text = "\n".join(cell.source for cell in student.cells)
    assert "secret" not in text
    assert "Before." in text
    assert "After." in text
    assert last_output(copy.deepcopy(student)).startswith("… not answered")
    student.cells[2].source = "def mass_outside(loc, scale, low, high):\n    return 2.0"
    assert last_output(student).startswith("✗ not yet: mass_outside")


def test_slips_of_an_author_are_refused() -> None:
    endless, headless = exercise(), exercise()
    del endless.cells[4:]
    del headless.cells[2:4]
    for notebook, complaint in ((endless, "does not end"), (headless, "without its")):
        with pytest.raises(ValueError, match=complaint):
            tool.student_copy(notebook)


def test_the_tag_or_the_place_is_enough() -> None:
    untagged, elsewhere = exercise(), exercise()
    untagged.cells[3].metadata = {}
    elsewhere.cells.append(elsewhere.cells[3].copy())
    for notebook in (untagged, elsewhere):
        assert not any("return 0.5" in cell.source for cell in tool.student_copy(notebook).cells)


def test_handing_out_never_takes_a_students_work(tmp_path: Path) -> None:
    chapters, folder = tmp_path / "notebooks", tmp_path / "lab"
    chapters.mkdir()
    chapter, theirs = chapters / "a.ipynb", folder / "01_a.ipynb"
    copies = {theirs.name: chapter}
    notebook = exercise()
    nbformat.write(notebook, chapter)
    assert tool.hand_out(copies, folder) == {"01_a.ipynb": "new"}
    assert tool.hand_out(copies, folder) == {"01_a.ipynb": "unchanged"}

    notebook.cells[0].source += "\nA better sentence."
    nbformat.write(notebook, chapter)
    assert tool.hand_out(copies, folder) == {"01_a.ipynb": "updated"}
    assert "A better sentence." in theirs.read_text()

    work = theirs.read_text().replace("return ...", "return 1")
    theirs.write_text(work)
    assert tool.hand_out(copies, folder) == {"01_a.ipynb": "kept"}
    notebook.cells[0].source += "\nA still better sentence."
    nbformat.write(notebook, chapter)
    assert tool.hand_out(copies, folder) == {"01_a.ipynb": "outdated"}
    assert theirs.read_text() == work

    theirs.rename(folder / "mine.ipynb")
    assert tool.hand_out(copies, folder) == {"01_a.ipynb": "new"}
    assert "A still better sentence." in theirs.read_text()


def test_chapters_are_numbered_as_the_book_orders_them(tmp_path: Path) -> None:
    toc = tmp_path / "_toc.yml"
    toc.write_text(
        "root: notebooks/front\nparts:\n"
        "  - chapters: [{file: book/preface}]\n"
        "  - numbered: 2\n    chapters: [{file: notebooks/b}, {file: notebooks/a}]\n"
        "  - numbered: 2\n    chapters: [{file: notebooks/c}]\n"
        "  - caption: Going deeper\n    chapters: [{file: notebooks/e}, {file: notebooks/d}]\n"
        "  - caption: Reference\n    chapters: [{file: book/api}]\n"
    )
    found = tool.chapters_in_order(toc)
    assert list(found) == ["01_b.ipynb", "02_a.ipynb", "03_c.ipynb", "deeper_e.ipynb", "deeper_d.ipynb"]
    assert found["02_a.ipynb"] == tmp_path / "notebooks" / "a.ipynb"
    assert all(path.is_file() for path in tool.chapters_in_order().values())


def test_downloads_are_student_copies(tmp_path: Path) -> None:
    chapters, downloads = tmp_path / "notebooks", tmp_path / "html" / "_sources" / "notebooks"
    chapters.mkdir()
    downloads.mkdir(parents=True)
    for name in ("01_a.ipynb", "02_not_in_the_book.ipynb"):
        nbformat.write(exercise(), chapters / name)
    nbformat.write(exercise(), downloads / "01_a.ipynb")
    page = tmp_path / "html" / "notebooks" / "03_gone.html"  # of a chapter that the book no longer has
    page.parent.mkdir()
    page.touch()
    nbformat.write(exercise(), downloads / "03_gone.ipynb")
    for _ in range(2):  # a page that was not built anew has its copy already
        tool.write_downloads(chapters, tmp_path / "html")
        assert [path.name for path in downloads.iterdir()] == ["01_a.ipynb"]
        assert not page.exists()
        assert "secret" not in json.dumps(json.loads((downloads / "01_a.ipynb").read_text()))


@pytest.mark.parametrize(
    "harm", [None, b"", b"not what you think", b"[1, 2]", b'{"01_a.ipynb": 3}', b"\xff\xfe"]
)
def test_a_lost_or_garbled_ledger_costs_no_work(harm: bytes | None, tmp_path: Path, capsys) -> None:
    chapters, folder = tmp_path / "notebooks", tmp_path / "lab"
    chapters.mkdir()
    copies = {name: chapters / name for name in ("01_a.ipynb", "02_b.ipynb")}
    for chapter in copies.values():
        nbformat.write(exercise(), chapter)
    tool.hand_out(copies, folder)
    work = (folder / "02_b.ipynb").read_text().replace("return ...", "return 1")
    (folder / "02_b.ipynb").write_text(work)
    if harm is None:
        (folder / tool.LEDGER).unlink()
    else:
        (folder / tool.LEDGER).write_bytes(harm)
    found = tool.hand_out(copies, folder)
    assert found == {"01_a.ipynb": "unchanged", "02_b.ipynb": "outdated"}
    assert ("is garbled and written anew" in capsys.readouterr().err) is (harm is not None)
    assert (folder / "02_b.ipynb").read_text() == work
    assert tool.hand_out(copies, folder)["01_a.ipynb"] == "unchanged"  # with the new ledger
    assert list(json.loads((folder / tool.LEDGER).read_text())) == ["01_a.ipynb"]
