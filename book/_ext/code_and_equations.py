"""The directive ``{code-and-equations}``: the numbered equations beside the code that computes them, and back.

``book/equations.toml`` names the code, and a test where no statement brings one; which equations there are, in which
order, and in which statement each stands, comes from the chapters. `tests/book/test_code_and_equations.py` sees that
neither side lacks anything.
"""

import re
import tomllib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import nbformat
import statements
from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

BLOCK = re.compile(
    r"^(`{3,}|:{3,})\{prf:(\w+)\}[^\n]*\n(?::label:[ \t]*(\S+)[ \t]*\n)?.*?^\1[ \t]*$", re.M | re.S
)
LABEL = re.compile(r"\$\$[ \t]*\n?\(([\w-]+)\)|\{math\}[^\n]*\n:label:[ \t]*([\w-]+)")


@dataclass(frozen=True)
class Equation:
    """A numbered equation.

    Args:
        label: to refer to it.
        chapter: the notebook's name, without its ending.
        statement: the label of the theorem (proposition, ...) in which, or in whose proof, it stands.
    """

    label: str
    chapter: str
    statement: str | None


@dataclass(frozen=True)
class Entry:
    """What ``book/equations.toml`` says of an equation or a statement.

    Args:
        says: the equation in words; a statement has a title of its own.
        code: public names of the package.
        tests: `file::function`, beside those of the statement.
        exempt: why nothing in the package computes it.
    """

    says: str = ""
    code: tuple[str, ...] = ()
    tests: tuple[str, ...] = field(default=())
    exempt: str = ""


def equations(notebooks: Path) -> Iterator[Equation]:
    """Yield the labelled equations of the chapters, in the book's order."""
    for path in statements.in_order(notebooks):
        last = None  # the statement whose proof may follow
        for cell in nbformat.read(path, as_version=4).cells:
            if cell.cell_type == "markdown":
                blocks = []
                for block in BLOCK.finditer(cell.source):
                    last = block[3] if block[2] in statements.PROVED else last
                    if block[2] in (*statements.PROVED, "proof"):
                        blocks.append((block.span(), last))
                for found in LABEL.finditer(cell.source):
                    around = [name for (start, end), name in blocks if start < found.start() < end]
                    yield Equation(found[1] or found[2], path.stem, around[0] if around else None)


def entries(book: Path) -> dict[str, Entry]:
    """Return what is known of each label."""
    table = tomllib.loads((book / "equations.toml").read_text(encoding="utf8"))
    return {
        label: Entry(
            says=entry.get("says", ""),
            code=tuple(entry.get("code", ())),
            tests=tuple(entry.get("tests", ())),
            exempt=entry.get("exempt", ""),
        )
        for label, entry in table.items()
    }


def link(name: str) -> str:
    """Return the link to a public name, shown as `Class`, `Class.method` or `module.function`."""
    *_, owner, last = name.split(".")
    return f"{{py:obj}}`{last if last[0].isupper() else f'{owner}.{last}'} <{name}>`"


def shown_code(entry: Entry) -> str:
    """Return the links to the code, or why there is none."""
    return ", ".join(map(link, entry.code)) or f"– {entry.exempt}"


def shown_tests(entry: Entry, statement: str | None) -> str:
    """Return where the tests are; the name of a test is a sentence."""
    parts = [f"tests of {{prf:ref}}`{statement}`"] if statement else []
    for test in entry.tests:
        file, _, function = test.partition("::")
        sentence = function.removeprefix("test_").replace("_", " ")
        parts.append(f"*{sentence}*, `{file.removeprefix('tests/')}`")
    return "; ".join(parts) or "–"


def row(*cells: str) -> Iterator[str]:
    """Yield the lines of a row of a list-table."""
    for i, cell in enumerate(cells):
        yield f"{'* -' if i == 0 else '  -'} {cell}"


def to_code(
    numbered: list[Equation],
    proved: list[statements.Statement],
    known: dict[str, Entry],
    order: Iterable[str],
) -> Iterator[str]:
    """Yield the first half of the page: a table per chapter, in order, equations first, then statements with code."""
    wanted = {e.chapter for e in numbered} | {s.chapter for s in proved if s.label in known}
    for chapter in (name for name in order if name in wanted):
        yield from ("", f"**{{doc}}`../notebooks/{chapter}`**", "")
        yield from (":::{list-table}", ":header-rows: 1", ":widths: 34 33 33", "")
        yield from row("Equation", "Code", "Checked by")
        for equation in (e for e in numbered if e.chapter == chapter):
            entry = known[equation.label]
            what = f"{{eq}}`{equation.label}` {entry.says}"
            yield from row(what, shown_code(entry), shown_tests(entry, equation.statement))
        for statement in (s for s in proved if s.chapter == chapter and s.label in known):
            entry = known[statement.label]
            what = f"{{prf:ref}}`{statement.label}`: {statement.title}"
            yield from row(what, shown_code(entry), shown_tests(entry, statement.label))
        yield ":::"


def to_equations(known: dict[str, Entry], order: list[str]) -> Iterator[str]:
    """Yield the second half: each public name with what it computes."""
    users: dict[str, list[str]] = {}
    for label in order:
        for name in known[label].code if label in known else ():
            users.setdefault(name, []).append(label)
    yield from (":::{list-table}", ":header-rows: 1", ":widths: 50 50", "")
    yield from row("Code", "Equations and statements")
    for name in sorted(users, key=str.casefold):
        links = [f"{{eq}}`{x}`" if x.startswith("eq-") else f"{{prf:ref}}`{x}`" for x in users[name]]
        yield from row(link(name), ", ".join(links))
    yield ":::"


class CodeAndEquations(SphinxDirective):
    """One half of the page; its argument is ``code`` or ``equations``, what is looked for."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Parse the generated Markdown in place."""
        root = Path(self.env.srcdir)
        pages = statements.in_order(root / "notebooks")
        for path in (root / "_toc.yml", root / "book" / "equations.toml", *pages):
            self.env.note_dependency(str(path))
        in_book = set(self.env.found_docs)
        numbered = [e for e in equations(root / "notebooks") if f"notebooks/{e.chapter}" in in_book]
        proved = [s for s in statements.statements(root / "notebooks") if f"notebooks/{s.chapter}" in in_book]
        known = entries(root / "book")
        if unlisted := [e.label for e in numbered if e.label not in known]:
            raise self.error(
                f"name the code of {', '.join(unlisted)} in book/equations.toml, or why there is none"
            )
        order = [found.label for found in (*numbered, *proved)]
        looked_for = {
            "code": to_code(numbered, proved, known, (path.stem for path in pages)),
            "equations": to_equations(known, order),
        }
        container = nodes.container()
        lines = StringList(list(looked_for[self.arguments[0]]), source="code-and-equations")
        self.state.nested_parse(lines, self.content_offset, container)
        return container.children


def setup(app: Sphinx) -> dict[str, object]:
    """Register the directive (called by Sphinx)."""
    app.add_directive("code-and-equations", CodeAndEquations)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
