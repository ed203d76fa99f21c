"""A page of figures and tables in one HTML file that asks nothing of any other: no script, no font, no server."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape

from matplotlib.figure import Figure

from inbounds.book.drawing.alt_text import last_picture

_CSS = """
:root { color-scheme: light; }
body { font: 17px/1.5 system-ui, sans-serif; color: #22272d; background: #fff; margin: 0 auto; max-width: 82rem;
  padding: 1rem; }
h1, h2, h3, p, ul, figure { max-width: 48rem; }
h1, h2, h3 { line-height: 1.25; }
h2 { margin-top: 3rem; border-top: 2px solid #5f6770; padding-top: .6rem; }
a { color: #0b4f9e; }
figure { margin: 1.5rem 0; }
figure img { max-width: 100%; height: auto; display: block; }
figcaption { color: #3d444c; }
.table { overflow-x: auto; margin: 1.5rem 0; }
table { border-collapse: collapse; font-size: .82rem; font-variant-numeric: tabular-nums; }
caption { text-align: left; padding-bottom: .4rem; font-size: .95rem; }
th, td { padding: .2rem .7rem .2rem 0; text-align: right; vertical-align: top; }
th { border-bottom: 1.5px solid #5f6770; }
tbody tr { border-bottom: 1px solid #dfe3e8; }
th:first-child, td:first-child, .words { text-align: left; }
th, td { white-space: nowrap; }
.long { white-space: normal; min-width: 14rem; }
.missing { color: #5f6770; font-style: italic; }
nav ul { columns: 2; }
"""


_LONG = 50  # characters: a table's cell with more of them may break into lines


def page(title: str, parts: Iterable[str]) -> str:
    """Return the whole page.

    Args:
        title: of the page, plain text.
        parts: of its body, HTML.

    Example:
        >>> page("A & B", [paragraph("x < y")]).count("A &amp; B")
        2
    """
    return "\n".join(
        [
            '<!doctype html>\n<html lang="en-GB">\n<head>\n<meta charset="utf-8">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            f"<title>{escape(title)}</title>\n<style>{_CSS}</style>\n</head>\n<body>\n<main>",
            f"<h1>{escape(title)}</h1>",
            *parts,
            "</main>\n</body>\n</html>\n",
        ]
    )


def heading(text: str, level: int = 2, anchor: str = "") -> str:
    """Return a heading, plain text, with an optional anchor."""
    place = f' id="{anchor}"' if anchor else ""
    return f"<h{level}{place}>{escape(text)}</h{level}>"


def contents(sections: Iterable[tuple[str, str]]) -> str:
    """Return links to sections, given as (anchor, title)."""
    links = "".join(f'<li><a href="#{anchor}">{escape(title)}</a></li>' for anchor, title in sections)
    return f'<nav aria-label="Contents"><ul>{links}</ul></nav>'


def paragraph(text: str, kind: str = "") -> str:
    """Return a paragraph of plain text; "missing" sets it back."""
    look = f' class="{kind}"' if kind else ""
    return f"<p{look}>{escape(text)}</p>"


def bullets(items: Iterable[str]) -> str:
    """Return a list of plain texts."""
    return "<ul>" + "".join(f"<li>{escape(item)}</li>" for item in items) + "</ul>"


_PART = (
    "flex:1 1 auto;padding:.1rem .6rem;border:1px solid #5f6770;border-radius:3px;text-align:center;margin:0;"
    "background:linear-gradient(90deg,rgba(31,130,119,.3) {share:.0%},transparent {share:.0%})"
)


def progress(parts: Mapping[str, tuple[int, int]]) -> str:
    """Return one strip that says of each part how many of its cells are finished, of how many.

    Example:
        >>> "Hopper: 2 of 3" in progress({"Hopper": (2, 3)})
        True
    """
    told = "".join(
        f'<li style="{_PART.format(share=done / planned)}">{escape(name)}: {done} of {planned}</li>'
        for name, (done, planned) in parts.items()
    )
    look = "display:flex;flex-wrap:wrap;gap:.3rem;list-style:none;padding:0;margin:1rem 0;max-width:none"
    return f'<p>Finished:</p><ul style="{look}">{told}</ul>'


def figure(fig: Figure, alt: str, caption: str = "") -> str:
    """Return a figure with its alt text, and close it.

    Raises:
        ValueError: the alt text says less than a sentence would.
    """
    png, width = last_picture(fig, alt)
    image = f'<img src="data:image/png;base64,{png}" width="{width}" alt="{escape(alt)}">'
    return f"<figure>{image}<figcaption>{escape(caption)}</figcaption></figure>"


def table(
    caption: str, head: Sequence[str], rows: Sequence[Sequence[str]], words: Sequence[int] = (0,)
) -> str:
    """Return a table of plain texts.

    Args:
        caption: what it shows, and of how many seeds.
        head: titles of the columns.
        rows: each as long as the head; a text may have lines.
        words: which columns hold words rather than numbers.

    Example:
        >>> "<td>5</td>" in table("Returns.", ["robot", "mean"], [["Ant", "5"]])
        True
    """

    def cell(tag: str, place: int, text: str) -> str:
        looks = {
            "words": place in words,
            "missing": text == "missing",
            "long": max(map(len, text.split("\n"))) > _LONG,
        }
        chosen = " ".join(name for name, wanted in looks.items() if wanted)
        attribute = f' class="{chosen}"' if chosen else ""
        lines = escape(text).replace("\n", "<br>")
        return f"<{tag}{attribute}>{lines}</{tag.partition(' ')[0]}>"

    titles = "".join(cell('th scope="col"', i, title) for i, title in enumerate(head))
    body = "".join(
        "<tr>" + "".join(cell("td", i, text) for i, text in enumerate(row)) + "</tr>" for row in rows
    )
    return (
        f'<div class="table"><table><caption>{escape(caption)}</caption>'
        f"<thead><tr>{titles}</tr></thead><tbody>{body}</tbody></table></div>"
    )
