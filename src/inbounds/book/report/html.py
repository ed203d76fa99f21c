"""Figures and tables in HTML that asks nothing of any other file: no script, no font, no server.

Texts are plain and are escaped on the way (`templates/report.html`); the parts that these functions return are HTML.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from matplotlib.figure import Figure

from inbounds.book.drawing.alt_text import last_picture
from inbounds.book.templates import macros

KIND = "inbounds-study"
"""Class by which the book's style sheet knows a view of the study."""
COLORS = 128
"""Of a figure in two shapes: as many as bands and lines need, and both together no more bytes than one with all."""
_HTML = macros("report")
_INTERVAL = re.compile(r"(?<=\[)([−-]?[\d.,\u202f]+), (?=[−-]?[\d.,\u202f]+\])")


def together(text: str) -> str:
    r"""Return a text in which no line ends within an interval, within "σ = 1", or before a per cent sign.

    Example:
        >>> together("12 % [3, 21] at σ = 1").split(" ")
        ['12\xa0%', '[3,\xa021]', 'at', 'σ\xa0=\xa01']
    """
    kept = _INTERVAL.sub("\\1,\N{NO-BREAK SPACE}", text)
    kept = re.sub(r"(?<=\d) %", "\N{NO-BREAK SPACE}%", kept)
    return re.sub(r"(?<=\b[α-ω]) = (?=[−\d])", "\N{NO-BREAK SPACE}=\N{NO-BREAK SPACE}", kept)


@dataclass(frozen=True)
class Shown:
    """What a page shows as HTML, and a stored notebook keeps as a few words that no new measurement changes.

    Example:
        >>> Shown("a table", [paragraph("5 of 6")])
        <a table>
    """

    what: str
    """In a few words, without numbers."""
    parts: Sequence[str]
    """HTML, one below the other."""
    kind: str = ""
    """Class of its box, such as `KIND`."""

    @property
    def html(self) -> str:
        """All parts."""
        return "\n".join(self.parts)

    def __repr__(self) -> str:
        return f"<{self.what}>"

    def _repr_html_(self) -> str:
        kind = f' class="{self.kind}"' if self.kind else ""
        return f'<div style="overflow-x:auto"><div{kind}>\n{self.html}\n</div></div>'


def of_study(what: str, *parts: str) -> Shown:
    """Return a view of the study.

    Args:
        what: in a few words, without numbers.
        *parts: HTML.
    """
    return Shown(f"study: {what}", parts, KIND)


def page(title: str, parts: Iterable[str]) -> str:
    """Return a whole page.

    Args:
        title: of the page, plain text.
        parts: of its body, HTML.

    Example:
        >>> page("A & B", [paragraph("x < y")]).count("A &amp; B")
        2
    """
    return f"{_HTML.page(title, parts)}\n"


def heading(text: str, level: int = 2, anchor: str = "") -> str:
    """Return a heading, plain text, with an optional anchor."""
    return str(_HTML.heading(text, level, anchor))


def contents(sections: Iterable[tuple[str, str]]) -> str:
    """Return links to sections, given as (anchor, title)."""
    return str(_HTML.contents(sections))


def paragraph(text: str) -> str:
    """Return a paragraph of plain text."""
    return str(_HTML.paragraph(text))


def missing(text: str) -> str:
    """Return a paragraph that says what is missing, set back."""
    return str(_HTML.paragraph(text, "missing"))


def bullets(items: Iterable[str]) -> str:
    """Return a list of plain texts."""
    return str(_HTML.bullets(items))


def progress(parts: Mapping[str, tuple[int, int]]) -> str:
    """Return one strip that says of each part how many of its cells are finished, of how many.

    Example:
        >>> "Hopper: 2 of 3" in progress({"Hopper": (2, 3)})
        True
    """
    return str(_HTML.progress(parts))


def figure_of(draw: Callable[[bool], Figure], alt: str, caption: str = "") -> str:
    """Return a figure that a page of a phone's width shows in another shape: panels below each other.

    Args:
        draw: draws it, narrow or wide.
        alt: what both show.
        caption: below it.

    Raises:
        ValueError: the alt text says less than a sentence would.
    """
    narrow, narrow_width = last_picture(draw(True), alt, colors=COLORS)
    png, width = last_picture(draw(False), alt, colors=COLORS)
    return str(_HTML.figure(png, width, alt, together(caption), narrow, narrow_width))


def table(
    caption: str,
    head: Sequence[str],
    rows: Sequence[Sequence[str]],
    words: Sequence[int] = (0,),
    anchors: Sequence[str] = (),
) -> str:
    """Return a table of plain texts.

    Args:
        caption: what it shows, and of how many seeds.
        head: titles of the columns.
        rows: each as long as the head; a text may have lines.
        words: which columns hold words rather than numbers.
        anchors: of the rows, one each, for links to them; none by default.

    Example:
        >>> "<td>5</td>" in table("Returns.", ["robot", "mean"], [["Ant", "5"]])
        True
    """
    return _table(caption, head, {"": rows}, words, anchors)


def parted_table(
    caption: str,
    head: Sequence[str],
    parts: Mapping[str, Sequence[Sequence[str]]],
    words: Sequence[int] = (0,),
) -> str:
    """Return a table of plain texts in parts, each under a heading.

    Args:
        caption: what it shows, and of how many seeds.
        head: titles of the columns.
        parts: heading → rows, each as long as the head; no heading where that is empty.
        words: which columns hold words rather than numbers.

    Example:
        >>> found = {"Ant": [["Beta", "5"]], "Hopper": [["Beta", "6"]]}
        >>> parted_table("Returns.", ["law", "mean"], found).count("<tbody>")
        2
    """
    return _table(caption, head, parts, words, ())


def _table(
    caption: str,
    head: Sequence[str],
    parts: Mapping[str, Sequence[Sequence[str]]],
    words: Sequence[int],
    anchors: Sequence[str],
) -> str:
    kept = {title: [[together(text) for text in row] for row in rows] for title, rows in parts.items()}
    return str(_HTML.table(together(caption), head, kept, words, anchors))


def fold(title: str, inside: str) -> str:
    r"""Return HTML under a title, plain text, that shows it when it is asked to.

    Example:
        >>> fold("All of it", paragraph("x < y"))
        '<details><summary>All of it</summary>\n<p>x &lt; y</p>\n</details>'
    """
    return str(_HTML.fold(title, inside))


def with_code(text: str) -> str:
    """Let words between backticks stand in the typewriter's face.

    Args:
        text: HTML.

    Example:
        >>> with_code("run `make`")
        'run <code>make</code>'
    """
    return re.sub(r"`([^`]*)`", r"<code>\1</code>", text)


def links(caption: str, columns: Sequence[str], fields: Mapping[str, Mapping[str, tuple[str, str]]]) -> str:
    """Return a table whose fields are links.

    Args:
        caption: what it shows.
        columns: their names, the keys of every row.
        fields: row → column → text, and the address that it leads to.

    Example:
        >>> '<a href="b.html#c">x &lt; y</a>' in links("A table.", ["ppo"], {"Ant": {"ppo": ("x < y", "b.html#c")}})
        True
    """
    return str(_HTML.links(caption, columns, fields))


NONE_FINISHED = missing("missing: none of these cells is finished.")
"""What stands in place of cells of which none is finished."""
