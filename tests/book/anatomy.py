"""What the pages of the book consist of, by kind; each function says in words what a page lacks."""

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

import nbformat

from inbounds.book.pages.contents import contents

ROOT = Path(__file__).resolve().parents[2]
PAGES = contents(ROOT / "_toc.yml")
REWRITTEN = tuple(tomllib.loads((ROOT / "book" / "budgets.toml").read_text(encoding="utf8"))["rewritten"])

CORE = (
    # what, how it is recognised, whether every chapter has it; in this order
    ("a question in bold behind the title", r"\A# [^\n]+\n+\*\*[^*\n]+\?\*\*", True),
    ("## What you will know", r"^## What you will know$", True),
    ("{admonition} Teach it", r"^(?:`{3,}|:{3,})\{admonition\} Teach it$", True),
    ("{admonition} Predict", r"^(?:`{3,}|:{3,})\{admonition\} Predict$", True),
    ("## Build it", r"^## Build it\b", False),
    ("## Run it", r"^## Run it\b", False),
    ("## Pitfalls", r"^## Pitfalls$", False),
    ("## Exercises", r"^## Exercises$", True),
    ("## Summary", r"^## Summary$", True),
)
DIFFICULTY = re.compile(r" \(\d+ min, (?:easy|medium|hard)\)$")
BACK = re.compile(r"\A# [^\n]+\n+\*Going deeper, from \{doc\}`(?:[^`<]*<)?([\w-]+)>?`\.\*")
KEY = re.compile(r"^(?:\d+\. )?\*\*\([a-z](?:, [a-z])*\)\*\*", re.M)
SHOWS = re.compile(r"\b(?:show_films|figures\.show|study_pages\.films(?:_of)?)\(")


def cells_of(path: Path) -> list[nbformat.NotebookNode]:
    return nbformat.read(path, as_version=4).cells


def prose_of(path: Path) -> str:
    return "\n\n".join(cell.source for cell in cells_of(path) if cell.cell_type == "markdown")


def block(prose: str, opening: str) -> str:
    """A fenced block, from the line with its opening to the fence that closes it."""
    found = re.search(rf"^(`{{3,}}|:{{3,}})\{{admonition\}} {opening}$.*?^\1[ \t]*$", prose, re.M | re.S)
    return found[0] if found else ""


def core_lacks(path: Path) -> Iterator[str]:
    """What a rewritten core chapter lacks."""
    prose, last = prose_of(path), -1
    for what, pattern, needed in CORE:
        found = re.search(pattern, prose, re.M)
        if needed and not found:
            yield what
        if found and found.start() < last:
            yield f"{what}: it stands before what should precede it"
        last = found.start() if found else last
    known = re.search(r"^## What you will know$(.*?)(?=^## |^`{3,}\{|^:{3,}\{|\Z)", prose, re.M | re.S)
    if known and len(re.findall(r"^[-*] ", known[1], re.M)) != 3:
        yield "three lines under What you will know"
    yield from teach_lacks(block(prose, "Teach it"))
    yield from predict_lacks(block(prose, "Predict"))
    for title in re.findall(r"\{exercise-start\}[ \t]*(.*)$", prose, re.M):
        if not DIFFICULTY.search(title):
            yield f"minutes and difficulty of the exercise {title!r}: (10 min, easy)"
    if not shows_before_stating(cells_of(path)):
        yield "a film, a figure or an explorable before the first definition"


def predict_lacks(box: str) -> Iterator[str]:
    """What a Predict box lacks; whether keys and options fit one another, the build checks (`book/_ext/guesses.py`)."""
    if "{dropdown}" not in box:
        yield "an answer to Predict, in a {dropdown}"
    guesses = re.findall(r"^(`{3,})\{guess\}$(.*?)^\1$", box, re.M | re.S)
    if not guesses:
        yield "a question in Predict that takes a guess, in a {guess}"
    choices = sum(":truth:" not in guess for _, guess in guesses)
    if len(KEY.findall(box)) < choices:
        yield f"{choices} keys in the answer to Predict, like **(b)**"


def teach_lacks(fold: str) -> Iterator[str]:
    """What the lecturer's plan lacks."""
    if not re.search(r"^:class:.*\bdropdown\b.*\bteach\b", fold, re.M):
        yield "the classes `dropdown teach` of Teach it"
    for word in ("planned minutes", "50", "90"):
        if word not in fold:
            yield f"{word!r} in Teach it"


def shows_before_stating(cells: list[nbformat.NotebookNode]) -> bool:
    """Whether something is shown before the first definition, statement or check."""
    explorables: set[str] = set()
    for cell in cells:
        if cell.cell_type == "markdown" and re.search(r"\{prf:(?!ref\})|\*\*Check it", cell.source):
            return False
        if cell.cell_type == "code":
            for names in re.findall(
                r"^from inbounds\.book\.explorables[.\w]* import (.+)$", cell.source, re.M
            ):
                explorables |= set(re.findall(r"\w+", names))
            if SHOWS.search(cell.source) or any(
                re.search(rf"\b{name}\(", cell.source) for name in explorables
            ):
                return True
    return False


def depth_lacks(path: Path) -> Iterator[str]:
    """What a page of Going deeper lacks, the link from its chapter included."""
    prose = prose_of(path)
    back = BACK.search(prose)
    if not back:
        yield "the line *Going deeper, from {doc}`chapter`.* behind the title"
    elif back[1] not in PAGES.core:
        yield f"a core chapter to come from: {back[1]!r} is none"
    elif not re.search(
        rf"\{{doc\}}`(?:[^`<]*<)?{path.stem}>?`", prose_of(path.with_name(f"{back[1]}.ipynb"))
    ):
        yield f"a link from {back[1]}: {{doc}}`{path.stem}`"
    if not re.search(r"^## Summary$", prose, re.M):
        yield "## Summary"
    for title in re.findall(r"\{exercise-start\}[ \t]*(.*)$", prose, re.M):
        if not DIFFICULTY.search(title):
            yield f"minutes and difficulty of the exercise {title!r}: (10 min, easy)"
