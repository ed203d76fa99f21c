"""The directive ``{statement-tests}``: every theorem of the book beside the tests that check it.

``book/statements.toml`` names the tests; the statements themselves, their titles and their order come from the
chapters. `tests/book/test_statements.py` sees that neither list lacks anything.
"""

import re
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import nbformat
from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from inbounds.book.pages.contents import Contents, contents

PROVED = ("theorem", "proposition", "lemma", "corollary")
PROOF_DIRECTIVE = re.compile(r"\{prf:(\w+)\}[ \t]*(.*)\n:label:[ \t]*(\S+)")


@dataclass(frozen=True)
class Statement:
    """What a chapter proves.

    Args:
        kind: theorem, proposition, lemma or corollary.
        title: as in the chapter.
        label: to refer to it.
        chapter: the notebook's name, without its ending.
    """

    kind: str
    title: str
    label: str
    chapter: str


def in_order(notebooks: Path) -> list[Path]:
    """Return the notebooks of a folder in the order of the table of contents beside it; others follow, by name."""
    toc = notebooks.parent / "_toc.yml"
    known = contents(toc) if toc.is_file() else Contents((), ())
    places = {name: i for i, name in enumerate((*known.core, *known.depth))}
    return sorted(notebooks.glob("*.ipynb"), key=lambda path: (places.get(path.stem, len(places)), path.stem))


def statements(notebooks: Path) -> Iterator[Statement]:
    """Yield what the chapters prove, in the book's order."""
    for path in in_order(notebooks):
        for cell in nbformat.read(path, as_version=4).cells:
            if cell.cell_type == "markdown":
                for kind, title, label in PROOF_DIRECTIVE.findall(cell.source):
                    if kind in PROVED:
                        yield Statement(kind, title.strip(), label, path.stem)


def tests_of(book: Path) -> dict[str, list[str]]:
    """Return the tests of each statement, `file::function`, by its label."""
    return tomllib.loads((book / "statements.toml").read_text(encoding="utf8"))


def page(found: list[Statement], tests: dict[str, list[str]]) -> Iterator[str]:
    """Yield the lines of the page, in MyST Markdown."""
    chapter = None
    for statement in found:
        if statement.chapter != chapter:
            chapter = statement.chapter
            yield from ("", f"**{{doc}}`../notebooks/{chapter}`**", "")
        yield f"::::{{dropdown}} {statement.kind.capitalize()}: {statement.title}"
        yield from (f"{{prf:ref}}`{statement.label}`", "")
        for test in tests[statement.label]:
            file, _, function = test.partition("::")
            yield from (f"`pytest {test}`", "", f":::{{literalinclude}} ../{file}")
            yield from (f":pyobject: {function}", ":language: python", ":::", "")
        if not tests[statement.label]:
            yield f"Checked by the chapter's own cells: `pytest --nbval notebooks/{statement.chapter}.ipynb`"
        yield "::::"


class StatementTests(SphinxDirective):
    """The page's content."""

    def run(self) -> list[nodes.Node]:
        """Parse the generated Markdown in place."""
        root = Path(self.env.srcdir)
        for path in (root / "_toc.yml", root / "book" / "statements.toml", *in_order(root / "notebooks")):
            self.env.note_dependency(str(path))
        in_book = set(self.env.found_docs)
        found = [s for s in statements(root / "notebooks") if f"notebooks/{s.chapter}" in in_book]
        tests = tests_of(root / "book")
        if unlisted := [s.label for s in found if s.label not in tests]:
            raise self.error(f"name the tests of {', '.join(unlisted)} in book/statements.toml")
        container = nodes.container()
        lines = StringList(list(page(found, tests)), source="statements")
        self.state.nested_parse(lines, self.content_offset, container)
        return container.children


def setup(app: Sphinx) -> dict[str, object]:
    """Register the directive (called by Sphinx)."""
    app.add_directive("statement-tests", StatementTests)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
