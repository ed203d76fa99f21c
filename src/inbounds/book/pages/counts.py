"""What a reader meets on a page: words, visible lines of code, statements, intervals in one paragraph.

What counts, and what does not:

* **Words** are those of the prose, folds included, without exercises, their solutions and *Teach it*. A formula is one
  word, in a line or displayed; a glued number is one word.
* **Visible lines** are the lines with something on them of cells that show their code, of programs in the prose, and
  of ``{program-diff}``. Exercises do not count, nor does the listing that ``{program-listing}`` folds away.
* **Statements** are theorems, propositions, lemmas and corollaries.
* **Intervals** are pairs of glued numbers, or glued texts with such a pair in them; a table row is no paragraph.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from inbounds.book.pages import glue
from inbounds.book.pages.cells import read_cells
from inbounds.book.pages.programs import diff

HIDDEN = frozenset({"hide-input", "hide-cell", "remove-input", "remove-cell"})
"""Tags of cells whose code a page does not show."""
STATEMENT = re.compile(r"\{prf:(?:theorem|proposition|lemma|corollary)\}")
FENCE = re.compile(r"^(?P<fence>`{3,}|:{3,})(?P<name>[^\n`]*)\n(?P<body>.*?)^(?P=fence)[ \t]*$", re.M | re.S)
ROLE = re.compile(r"\{[\w:+-]+\}`([^`]*)`")
NUMBER = r"[−-]?\d[\d.,\u202f\s]*%?"
PAIR = re.compile(rf"{NUMBER}\s*(?:,|;|to|and|–)\s*{NUMBER}")
ONE = r"\ue000[^\ue000\ue001\[(]*\ue001[^\w\ue000,()\[\]]{0,3}"
BETWEEN_GLUED = re.compile(rf"{ONE}(?:to|–)\s+{ONE}|between\s+{ONE}and\s+{ONE}|[\[(]{ONE},\s+{ONE}[\])]")
"""Two glued numbers, each between two private characters, with what makes an interval of them."""


@dataclass(frozen=True)
class Counts:
    """What a reader meets on a page."""

    words: int
    """Of the prose."""
    lines: int
    """Of visible code."""
    statements: int
    """Theorems, propositions, lemmas, corollaries."""
    intervals: int
    """In the paragraph that has most of them."""
    fullest: str = ""
    """That paragraph's beginning."""

    def minutes(self) -> int:
        """Return about how long the page takes to read: 150 words or 15 lines of code a minute.

        Example:
            >>> Counts(words=2400, lines=60, statements=2, intervals=1).minutes()
            20
        """
        return max(1, round(self.words / 150 + self.lines / 15))


def count_page(notebook: Path) -> Counts:
    """Count a stored notebook, with the changes of its program where the page shows them (``{program-diff}``)."""
    cells = read_cells(notebook)
    found = count(cells)
    if any(line.startswith("```{program-diff}") for line in taught(cells)[0].splitlines()):
        found = replace(found, lines=found.lines + _filled(diff(notebook)))
    return found


def count(cells: Sequence[dict[str, Any]]) -> Counts:
    r"""Count a page.

    Args:
        cells: of a notebook, as `read_cells` returns them.

    Example:
        >>> cells = [
        ...     {"cell_type": "markdown", "source": "# Title\n\n**Is $x = 1$ a word?**"},
        ...     {"cell_type": "code", "source": "x = 1\n\nprint(x)"},
        ... ]
        >>> found = count(cells)
        >>> found.words, found.lines
        (5, 2)
    """
    prose, code = taught(cells)
    texts = dict(glue.glued(cells))
    paragraphs = list(_paragraphs(prose))
    fullest = max(paragraphs, key=lambda paragraph: intervals(paragraph, texts), default="")
    return Counts(
        words=len(re.findall(r"\w[\w’'.,%/+-]*", plain(prose))),
        lines=sum(map(_filled, code)) + sum(_filled(body) for body in programs_in(prose)),
        statements=len(STATEMENT.findall(prose)),
        intervals=intervals(fullest, texts),
        fullest=fullest[:60],
    )


def taught(cells: Sequence[dict[str, Any]]) -> tuple[str, list[str]]:
    """Return the prose that counts, as one text, and the visible cells of code that count."""
    prose, code, exercises, inside = [], [], False, 0
    for cell in cells:
        tags, source = set(cell.get("metadata", {}).get("tags", [])), cell["source"]
        if cell["cell_type"] == "code":
            if not (exercises or inside or tags & (HIDDEN | {"solution"})):
                code.append(source)
            continue
        if cell["cell_type"] != "markdown":
            continue
        left = []
        for line in source.splitlines():
            if line.startswith("## "):
                exercises = line.strip() == "## Exercises"
            inside += bool(re.match(r"`{3,}\{(?:exercise|solution)-start\}", line))
            if not (exercises or inside):
                left.append(line)
            if re.match(r"`{3,}\{(?:exercise|solution)-end\}", line):
                inside -= 1
                left.append("```{closing}")  # the fence's last line is still to come
        prose.append(re.sub(r"^```\{closing\}\n(?:```[ \t]*$)?", "", "\n".join(left), flags=re.M))
    return without_teach("\n\n".join(prose)), code


def without_teach(prose: str) -> str:
    """Cut the fold *Teach it* out of a text."""
    kept = [
        (found.start(), found.end())
        for found in FENCE.finditer(prose)
        if re.search(r"^:class:.*\bteach\b", found["body"], re.M)
    ]
    for start, end in reversed(kept):
        prose = prose[:start] + prose[end:]
    return prose


def programs_in(prose: str) -> Iterator[str]:
    """Yield the programs that stand in the prose, in fences of three backticks and the name of a language."""
    for found in FENCE.finditer(prose):
        if re.fullmatch(r"[a-z]+", found["name"].strip()):
            yield found["body"]
        else:
            yield from programs_in(found["body"])


def plain(prose: str) -> str:
    """Return a text as its words: without markup, programs and links; a formula and a glued number are a word each."""
    prose = re.sub(r"^```[a-z]+\n.*?^```[ \t]*$", "", prose, flags=re.M | re.S)
    prose = re.sub(
        r"^```+\{math\}.*?^```+[ \t]*$|\$\$.*?\$\$(?:[ \t]*\([\w-]+\))?",
        " formula ",
        prose,
        flags=re.M | re.S,
    )
    prose = re.sub(r"\$[^$]+\$", " formula ", prose)
    prose = re.sub(
        r"^(?:`{3,}|:{3,})(?:\{[^}]*\})?|^:[\w-]+:.*$|^\([\w-]+\)=$|<!--.*?-->", " ", prose, flags=re.M
    )
    prose = glue.ROLE.sub(" number ", prose)
    prose = ROLE.sub(lambda role: f" {re.sub(r'<[^>]*>', '', role[1])} ", prose)
    prose = re.sub(r"<[^>]+>", " ", prose)
    return re.sub(r"\]\([^)]*\)", " ", prose)


def intervals(paragraph: str, texts: dict[str, str] | None = None) -> int:
    """Return how many intervals a paragraph quotes.

    Args:
        paragraph: in MyST Markdown.
        texts: what each glued name shows, where that is a text.

    Example:
        >>> intervals("from {glue:text}`low` to {glue:text}`high`, then {glue:text}`b`", {"b": "3 [1, 5]"})
        2
    """
    shown = glue.ROLE.sub(lambda role: f"\ue000{(texts or {}).get(role[2], '')}\ue001", paragraph)
    inside = sum(len(PAIR.findall(text)) for text in re.findall(r"\ue000([^\ue001]*)\ue001", shown))
    return inside + len(BETWEEN_GLUED.findall(shown))


def _paragraphs(prose: str) -> Iterator[str]:
    """Yield the paragraphs of a text; an item of a list is one, the row of a table is none."""
    rows = re.compile(
        r"^[ \t]*\|[^\n]*$|^(`{3,}|:{3,})\{(?:list-table|table|csv-table)\}.*?^\1[ \t]*$", re.M | re.S
    )
    yield from (
        p for p in re.split(r"\n[ \t]*\n|\n(?=\s*(?:[-*]|\d+\.)\s)", rows.sub("", prose)) if p.strip()
    )


def _filled(code: str) -> int:
    """Return how many lines have something on them."""
    return sum(bool(line.strip()) for line in code.splitlines())
