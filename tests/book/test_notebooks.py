"""The stored notebooks are faithful records of a clean run, and the tools that say so cannot be fooled."""

import copy
import re
import subprocess
import sys
from pathlib import Path

import nbformat
import pytest

from tests.book import anatomy
from tools import notebook_hook

ROOT = Path(__file__).resolve().parents[2]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))

REFERENCE_PAGES = {
    # What the book found, for who has two minutes. Its numbers are glued, and its claims asserted where they are made.
    "front_page",
    # Six answers with their evidence, for who only wants to know what to use. Its words follow from the cells by rules
    # that tests/book/report/test_equal_start.py holds; its code is run by tests/book/test_which_policy.py.
    "which_policy",
    # A robot to play with, and how far it is the study's; tests/book/live and tests/pages/test_live_robot.py hold it.
    "live_robot",
}


def code_cells(notebook: nbformat.NotebookNode) -> list[nbformat.NotebookNode]:
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda p: p.stem)
def test_stored_notebook_is_clean(path: Path, capsys: pytest.CaptureFixture) -> None:
    assert notebook_hook.main(["--check", str(path)]) == 0, capsys.readouterr().out


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda p: p.stem)
def test_ignored_outputs_carry_no_claim(path: Path) -> None:
    """A cell that nbval does not compare may show, but neither assert nor grade."""
    for cell in code_cells(nbformat.read(path, as_version=4)):
        if "nbval-ignore-output" in cell.metadata.get("tags", []):
            assert "assert" not in cell.source
            assert "graders." not in cell.source
        assert "NBVAL" not in cell.source  # tags, not comments, say what nbval compares


def test_every_core_chapter_has_the_parts_of_one() -> None:
    """Those of `book/budgets.toml` are held to them by `test_anatomy`; so all of them are listed there."""
    assert set(anatomy.REWRITTEN) == set(anatomy.PAGES.core)


def test_reference_pages_exist() -> None:
    assert {path.stem for path in NOTEBOOKS} >= REFERENCE_PAGES


def test_every_erratum_is_checked() -> None:
    """Each entry says where, what and what instead, stands in the table, and is followed by a cell that asserts."""
    cells = nbformat.read(ROOT / "notebooks" / "errata.ipynb", as_version=4).cells
    page = "\n".join(f"<code>{c.source}" if c.cell_type == "code" else c.source for c in cells)
    front, *entries = re.split(r"^\((err-[a-z0-9-]+)\)=\n(?=#)", page, flags=re.MULTILINE)
    labels, texts = entries[::2], entries[1::2]
    assert re.findall(r"^\* - \{ref\}`.*<(err-.*)>`$", front, flags=re.MULTILINE) == labels[:-1]
    assert labels[-1] == "err-correct"
    for label, text in zip(labels, texts, strict=True):
        prose, *code = text.split("<code>")
        assert any(re.search(r"\bassert", cell) for cell in code), label
        assert "**Check.**" in prose, label
        if label != "err-correct":
            assert "**Where.**" in prose, label
            assert "**Printed.**" in prose or "**Omitted.**" in prose, label
            assert "**Right.**" in prose or "**Why it matters.**" in prose, label


def test_the_claims_are_generated() -> None:
    """Chapter and depth page show every claim, and say in words what a verdict is."""
    shown = {
        "claim_by_claim": ["claims(thesis)", "claims(own)"],
        "how_a_claim_is_judged": ["study_pages.ledger(found)"],
    }
    for page, views in shown.items():
        cells = nbformat.read(ROOT / "notebooks" / f"{page}.ipynb", as_version=4).cells
        code = [cell.source.strip() for cell in cells if cell.cell_type == "code"]
        prose = "\n".join(cell.source for cell in cells if cell.cell_type == "markdown")
        assert any("found = study_pages.findings(outcomes)" in source for source in code)
        assert set(views) <= set(code)
        assert all(word in prose for word in ("**Supported**", "**Refuted**", "**Undecided**")), page
        assert re.search(r"\*\*missing\*\*", prose), page


def test_every_road_is_tried() -> None:
    """Each road stands in the table, is tried by a cell that asserts, and ends in a project, on either page."""
    cells = [
        cell
        for name in ("what_next", "other_laws_on_a_box")
        for cell in nbformat.read(ROOT / "notebooks" / f"{name}.ipynb", as_version=4).cells
    ]
    page = "\n".join(f"<code>{c.source}</code>" if c.cell_type == "code" else c.source for c in cells)
    front, *roads = re.split(r"^\((next-[a-z]+)\)=\n(?=#)", page, flags=re.MULTILINE)
    labels, texts = roads[::2], roads[1::2]
    assert re.findall(r"^\* - \{ref\}`.*<(next-.*)>`$", front, flags=re.MULTILINE) == labels
    projects = re.findall(r"^:label: (ex-20-\w+)$(?=(?:(?!^```).*\n)*?^```\n\n\*\*Project\.\*\*)", page, re.M)
    assert len(projects) == len(labels)
    for label, text in zip(labels, texts, strict=True):
        code = re.findall(r"<code>(.*?)</code>", text, flags=re.DOTALL)
        assert any(re.search(r"\bassert", cell) for cell in code), label
        assert "{prf:" in text, label
        assert "{cite" in text or "{prf:ref}`thm-invariance`" in text, label
    assert "None of this was part of the study" in front


def small_notebook(folder: Path) -> nbformat.NotebookNode:
    """The first chapter cut down to cells that run in a second, with one that prints a number."""
    notebook = copy.deepcopy(nbformat.read(NOTEBOOKS[0], as_version=4))
    number = nbformat.v4.new_code_cell("print(round(2 ** 0.5, 4))", execution_count=1)
    number.outputs = [nbformat.v4.new_output("stream", name="stdout", text="1.4142\n")]
    notebook.cells = [notebook.cells[0], number]
    nbformat.write(notebook, folder / "chapter.ipynb")
    return notebook


def nbval(folder: Path, *options: str) -> subprocess.CompletedProcess:
    return subprocess.run(
        [sys.executable, "tools/run_tests.py", *options, str(folder / "chapter.ipynb")],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )


def test_a_notebook_can_be_computed_as_on_an_old_processor(tmp_path: Path) -> None:
    notebook = small_notebook(tmp_path)
    notebook.cells[1].source = "import torch\n\nprint(torch.backends.cpu.get_cpu_capability())"
    notebook.cells[1].outputs[0].text = "DEFAULT\n"
    nbformat.write(notebook, tmp_path / "chapter.ipynb")
    done = nbval(tmp_path, "--other-processor")
    assert done.returncode == 0, done.stdout + done.stderr


def test_nbval_sees_a_changed_number_and_a_cell_that_raises(tmp_path: Path) -> None:
    """And lets the untouched cell before them pass."""
    notebook = small_notebook(tmp_path)
    changed = copy.deepcopy(notebook.cells[1])
    changed.id, changed.execution_count, changed.outputs[0].text = "changed", 2, "1.4143\n"
    raises = nbformat.v4.new_code_cell("raise ValueError('planted')", execution_count=3)
    notebook.cells += [changed, raises]
    nbformat.write(notebook, tmp_path / "chapter.ipynb")
    done = nbval(tmp_path)
    assert done.returncode != 0
    assert "notebooks: 1 passed, 2 failed" in done.stdout
    assert "1.4143" in done.stdout
    assert "planted" in done.stdout


@pytest.mark.slow
def test_nbval_sees_a_dead_kernel(tmp_path: Path) -> None:
    """nbval marks what follows a dead kernel as expected failures: that must not count as passing."""
    notebook = small_notebook(tmp_path)
    notebook.cells.append(nbformat.v4.new_code_cell("import os; os._exit(1)", execution_count=2))
    notebook.cells.append(nbformat.v4.new_code_cell("print('never')", execution_count=3))
    nbformat.write(notebook, tmp_path / "chapter.ipynb")
    assert nbval(tmp_path, "--cell-timeout=5").returncode != 0  # nbval waits for it as long as for any cell


def quote(cell: nbformat.NotebookNode, value: str) -> None:
    """Let a cell glue a value, and quote it with a format in the cell that it was copied from."""
    cell.source, cell.execution_count = "glue('answer', answer, display=False)", 1
    shown = nbformat.v4.new_output("display_data", data={"text/plain": value})
    shown.metadata = {"scrapbook": {"name": "answer"}}
    cell.outputs = [shown]


@pytest.mark.parametrize(
    ("plant", "complaint"),
    [
        (lambda cell: cell.update(execution_count=None, outputs=[]), "execution count None"),
        (lambda cell: cell.update(source="pass\n" * 26), "25 lines at most"),
        (
            lambda cell: cell.outputs.append(nbformat.v4.new_output("stream", name="stderr", text="w")),
            "stderr",
        ),
        (
            lambda cell: cell.outputs.append(
                nbformat.v4.new_output("error", ename="E", evalue="", traceback=[])
            ),
            "stores an error",
        ),
        (
            lambda cell: cell.outputs.append(
                nbformat.v4.new_output("display_data", data={"image/png": "aGk="})
            ),
            "stores pictures",
        ),
        (
            lambda cell: (
                cell.clear() or cell.update(nbformat.v4.new_markdown_cell("{glue:text}`answer:.0f`"))
            ),
            "quotes 'answer', which no cell glues",
        ),
        (
            lambda cell: (
                cell.clear() or cell.update(nbformat.v4.new_markdown_cell("{glue:text}`why.ipynb::std-beta`"))
            ),
            "quotes 'std-beta' of why.ipynb without the colon that ends it: std-beta:",
        ),
        (lambda cell: quote(cell, "np.float64(42.0)"), "formats 'answer', which is no plain number"),
    ],
)
def test_the_hook_sees(tmp_path: Path, plant, complaint: str, capsys: pytest.CaptureFixture) -> None:
    notebook = small_notebook(tmp_path)
    plant(notebook.cells[1])
    if "formats" in complaint:
        notebook.cells[0].source = "# A chapter\n\n{glue:text}`answer:.0f`"
    nbformat.write(notebook, tmp_path / "chapter.ipynb")
    assert notebook_hook.main(["--check", str(tmp_path / "chapter.ipynb")]) == 1
    assert complaint in capsys.readouterr().out


def test_the_hook_sees_a_name_that_is_glued_twice(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    notebook = small_notebook(tmp_path)
    glued = {"scrapbook": {"name": "answer"}}
    for _ in range(2):
        output = nbformat.v4.new_output("display_data", {"text/plain": "42"}, metadata=glued)
        notebook.cells[1].outputs.append(output)
    nbformat.write(notebook, tmp_path / "chapter.ipynb")
    assert notebook_hook.main(["--check", str(tmp_path / "chapter.ipynb")]) == 1
    assert "glues 'answer' 2 times" in capsys.readouterr().out


def test_the_hook_sees_a_name_that_the_page_does_not_make(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    notebook = small_notebook(tmp_path)
    hidden, shown = (nbformat.v4.new_code_cell(text) for text in ("def f(x):\n    return x", "f(1)"))
    notebook.cells = [hidden, shown]
    for tag, code in (("remove-cell", 1), ("hide-input", 0)):
        hidden.metadata["tags"] = [tag]
        for count, cell in enumerate(code_cells(notebook), 1):
            cell.execution_count = count
        nbformat.write(notebook, tmp_path / "chapter.ipynb")
        assert notebook_hook.main(["--check", str(tmp_path / "chapter.ipynb")]) == code
    said = capsys.readouterr().out
    assert said.count("uses 'f', which only a removed cell makes") == 1


def test_a_guess_at_what_no_cell_glues_is_noticed(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    notebook = small_notebook(tmp_path)
    quote(notebook.cells[1], "1.5")
    notebook.cells[0].source = "# A page\n\n```{guess}\n:truth: answer\n:within: 1\n\nHow many?\n```"
    nbformat.write(notebook, tmp_path / "chapter.ipynb")
    assert notebook_hook.main(["--check", str(tmp_path / "chapter.ipynb")]) == 0, capsys.readouterr().out
    notebook.cells[0].source = notebook.cells[0].source.replace("answer", "other")
    nbformat.write(notebook, tmp_path / "chapter.ipynb")
    assert notebook_hook.main(["--check", str(tmp_path / "chapter.ipynb")]) == 1
    assert "has a guess at 'other'" in capsys.readouterr().out


@pytest.mark.slow
def test_a_broken_notebook_fails_the_build(tmp_path: Path) -> None:
    """Jupyter Book exits 0 over a failing notebook unless told otherwise; our configuration tells it."""
    notebook = small_notebook(tmp_path)
    notebook.cells[0].source = "# A chapter"
    notebook.cells[1].source = "raise ValueError('planted')"
    nbformat.write(notebook, tmp_path / "chapter.ipynb")
    (tmp_path / "_toc.yml").write_text("format: jb-book\nroot: chapter\n")
    (tmp_path / "_config.yml").write_text(
        (ROOT / "_config.yml").read_text().replace("book/", f"{ROOT}/book/")
    )
    command = [
        Path(sys.executable).with_name("jupyter-book"),
        "build",
        tmp_path,
        "-q",
        "-W",
        "-n",
        "--keep-going",
    ]
    for _ in range(2):  # the second run, with everything cached, must fail as well
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
        assert done.returncode != 0
        assert "planted" in done.stdout + done.stderr


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_the_books_own_solutions_pass(path: Path) -> None:
    """A solution that its grader refuses, or a stub that was left without one, would be printed like any output."""
    for cell in nbformat.read(path, as_version=4).cells:
        for output in cell.get("outputs", []):
            said = str(output.get("data", {}).get("text/plain", ""))
            assert not said.startswith(("✗ not yet", "… not answered")), said
