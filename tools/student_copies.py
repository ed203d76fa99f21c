"""Student copies: the chapters without their solutions, so that *Run All* grades the student's own code.

    python tools/student_copies.py [FOLDER]    hand the chapters out into FOLDER (lab/), as `make lab` does

An exercise is a stub, a solution and a grader's cell. In the book the solution comes after the stub and takes its
place; here it is left out, prose and cells alike, from `{solution-start}` to `{solution-end}`, and so is any other
cell with the tag `solution`. JupyterLab does not know the role that shows a glued number; in a copy the number itself
stands there, as the book has it. The book's download button hands out the same copies (`tools/build_book.py`).

With the chapters go the build notebooks of `tools/build`: blanks for functions of the growing program, each with a
grader right after it, and the program around them.

A copy that a student has changed is never overwritten. Its first cell says what to install, and checks.
"""

import argparse
import ast
import copy
import hashlib
import json
import re
import sys
from collections.abc import Mapping
from pathlib import Path

import nbformat

from inbounds.book.pages.contents import contents
from inbounds.book.pages.glue import ROLE, glued
from inbounds.cli.classroom.ready import INSTALL

ROOT = Path(__file__).resolve().parents[1]
LEDGER = ".handed-out.json"
"""In the students' folder: the digest of each notebook as it was handed out."""
INSTEAD = "*The solution is in the book.*"
SHOWN_LATER = re.compile(r"^```\{glue\}[^\n]*\n```$", re.MULTILINE)
"""A directive that shows above what a later cell makes."""


def student_copy(notebook: nbformat.NotebookNode) -> nbformat.NotebookNode:
    """Return the notebook without its solutions, and without outputs, which are the book's and not the student's.

    Args:
        notebook: a chapter, unchanged by this.

    Raises:
        ValueError: the markers of a solution do not pair.
    """
    student = copy.deepcopy(notebook)
    student.cells, inside, values = [], False, {"": dict(glued(notebook.cells))}
    for cell in copy.deepcopy(notebook.cells):
        if cell.cell_type == "code":
            if inside or "solution" in cell.metadata.get("tags", []):
                continue
            cell.update(outputs=[], execution_count=None)
        else:
            left, inside = without_solutions(cell.source, inside)
            cell.source = with_numbers(left, values)
        if cell.source.strip():
            student.cells.append(cell)
    if student.cells:
        student.cells.insert(0, ready_cell())
    if inside:
        raise ValueError("a solution does not end: {solution-end} is missing")
    return student


def ready_cell() -> nbformat.NotebookNode:
    """Return the first cell of every copy: what to install, in a line, and whether it is there."""
    cell = nbformat.v4.new_code_cell(
        f"# To install, once, in the folder of the book: {INSTALL}\n"
        "from inbounds.cli.classroom.ready import ready\n\nready()"
    )
    cell.id = "ready"  # the same in every copy, so that a copy that nobody changed is known
    return cell


def without_solutions(text: str, inside: bool) -> tuple[str, bool]:
    """Cut solutions out of Markdown; one may begin and end in different cells.

    Args:
        text: of one cell.
        inside: whether the cell begins within a solution.

    Returns:
        What is left of the text, and whether it ends within a solution.
    """
    left, closing = [], False
    for line in text.splitlines():
        if line.startswith("```{solution-start}"):
            inside = True
            left.append(INSTEAD)
        elif line.startswith("```{solution-end}"):
            if not inside:
                raise ValueError("{solution-end} without its {solution-start}")
            closing = True
        elif closing and line.startswith("```"):
            inside = closing = False
        elif not inside:
            left.append(line)
    return "\n".join(left).strip("\n"), inside


def with_numbers(text: str, values: dict[str, dict[str, str]]) -> str:
    """Put glued numbers in the place of the roles that show them.

    Args:
        text: of one cell.
        values: notebook → name → `repr` of the value; "" is the notebook itself, others are read when they are met.

    Returns:
        The text. A role whose value is not stored stays as it is.
    """

    def shown(role: re.Match[str]) -> str:
        other, name, how = role[1] or "", role[2], role[3] or ""
        if other not in values:
            values[other] = dict(glued(nbformat.read(ROOT / "notebooks" / other, as_version=4).cells))
        if name not in values[other]:
            return role[0]
        try:
            return format(ast.literal_eval(values[other][name]), how)
        except (SyntaxError, ValueError):  # no literal: shown as it is stored
            return values[other][name]

    return SHOWN_LATER.sub("*A later cell shows this.*", ROLE.sub(shown, text))


def written(path: Path) -> str:
    """Return the student copy of a chapter, as the text of a notebook file."""
    notebook = nbformat.read(path, as_version=4)
    try:
        return nbformat.writes(student_copy(notebook)) + "\n"
    except ValueError as error:
        raise ValueError(f"{path.name}: {error}") from error


def chapters_in_order(toc: Path = ROOT / "_toc.yml") -> dict[str, Path]:
    """Return the notebooks as a class reads them, and the book's notebook of each.

    Core chapters are numbered, `01_actions_have_bounds.ipynb` and so on; the pages of *Going deeper* follow them as
    `deeper_NAME.ipynb`, and the build notebooks, in which a program's functions are blanks, as `build_NAME.ipynb`.

    Args:
        toc: the book's table of contents, at its root. A file has no number of its own there: chapters move.
    """
    pages, folder = contents(toc), toc.parent / "notebooks"
    copies = {f"{number:02}_{name}.ipynb": name for number, name in enumerate(pages.core, 1)}
    copies |= {f"deeper_{name}.ipynb": name for name in pages.depth}
    found = {copied: folder / f"{name}.ipynb" for copied, name in copies.items()}
    build = sorted((toc.parent / "tools" / "build").glob("*.ipynb"))
    return found | {f"build_{path.name}": path for path in build}


def hand_out(chapters: Mapping[str, Path], folder: Path) -> dict[str, str]:
    """Put a copy of every chapter into a student's folder, except over what the student has changed.

    Args:
        chapters: name in the student's folder → the book's notebook.
        folder: the student's; made if it is not there.

    Returns:
        By name: `new`, `unchanged`, `updated`, `kept` (the student changed it), or `outdated` (the student
        changed it, and the book has a newer version).
    """
    folder.mkdir(parents=True, exist_ok=True)
    ledger_file = folder / LEDGER
    ledger = read_ledger(ledger_file)
    outcome = {}
    for name, chapter in chapters.items():
        ours, theirs = written(chapter), folder / name
        before = digest(theirs.read_text(encoding="utf8")) if theirs.exists() else None
        if before == digest(ours):  # whatever the ledger says of it: nothing is the student's own
            ledger[name] = before
        if before is not None and before != ledger.get(name):
            outcome[name] = "kept" if digest(ours) == ledger.get(name) else "outdated"
            continue
        outcome[name] = "new" if before is None else "unchanged" if before == digest(ours) else "updated"
        if before != digest(ours):
            theirs.write_text(ours, encoding="utf8")
        ledger[name] = digest(ours)
    ledger_file.write_text(json.dumps(ledger, indent=1) + "\n", encoding="utf8")
    return outcome


def read_ledger(path: Path) -> dict[str, str]:
    """Return what was handed out, by name; nothing where the ledger is lost or garbled.

    A notebook that the ledger does not know counts as changed, so a lost ledger costs no student's work.
    """
    try:
        ledger = json.loads(path.read_text(encoding="utf8"))
    except FileNotFoundError:
        return {}
    except ValueError:  # no JSON, or no text
        ledger = None
    if isinstance(ledger, dict) and all(isinstance(entry, str) for entry in ledger.values()):
        return ledger
    print(
        f"{path} is garbled and written anew; notebooks that differ from the book's are kept", file=sys.stderr
    )
    return {}


def write_downloads(chapters: Path, html: Path) -> None:
    """Let the download buttons of a built book hand out student copies.

    Args:
        chapters: folder of the book's notebooks.
        html: the built book, where `_sources/notebooks/` holds what the buttons link to.
    """
    for download in sorted((html / "_sources" / chapters.name).glob("*.ipynb")):
        if (chapters / download.name).is_file():
            download.write_text(written(chapters / download.name), encoding="utf8")
        else:  # of a page that the book no longer has, which Sphinx leaves where it is
            download.unlink()
            (html / chapters.name / f"{download.stem}.html").unlink(missing_ok=True)


def digest(text: str) -> str:
    """Return a digest of a notebook's text."""
    return hashlib.sha256(text.encode()).hexdigest()


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", nargs="?", type=Path, default=ROOT / "lab")
    folder = parser.parse_args().folder
    for name, state in hand_out(chapters_in_order(), folder).items():
        note = {
            "kept": " (you changed it)",
            "outdated": " (you changed it; rename yours to get the book's newer version)",
        }
        print(f"{state:>9}  {name}{note.get(state, '')}")
    print(f"Chapters without solutions: {folder}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
