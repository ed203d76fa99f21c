"""What the search page knows of a page: title, kind, phrases of ``book/search.toml``, headings, a passage of each.

It stands in one script, ``_static/search_pages.js``: the search page fetches nothing, so its excerpts are there for a
book that is read from the disk, too. ``book/_static/search.js`` puts the pages that Sphinx finds in order.
"""

import json
import textwrap
import tomllib
from pathlib import Path
from typing import Any

import metadata
from docutils import nodes
from sphinx.application import Sphinx

from inbounds.book.pages.contents import contents

LONGEST = 220  # characters of a passage
PARTS = "search"  # folder beside the doctrees: a page that is not written again keeps what it said
SCRIPT = "search_pages.js"


def passage(section: nodes.Element) -> str:
    """Return the first paragraph of plain words of a section itself, in its text or else in a list, or nothing."""

    def own(paragraph: nodes.paragraph) -> bool:
        around = paragraph.parent
        while not isinstance(around, nodes.section | nodes.document):
            around = around.parent
        return around is section

    found = [each for each in section.findall(nodes.paragraph) if own(each) and metadata.is_plain(each)]
    long = [each for each in found if len(each.astext()) > 40]
    in_text = [each for each in long if each.parent is section]
    text = (in_text or long)[0].astext() if long else ""
    return textwrap.shorten(text, LONGEST, placeholder=" …", break_on_hyphens=False)


def sections(doctree: nodes.document) -> list[tuple[str, str, str]]:
    """Return anchor, heading and passage of every section of a page; the first is the page itself."""
    found = []
    for section in doctree.findall(nodes.section):
        title = section.next_node(nodes.title)
        if title is not None and title.parent is section and section["ids"]:
            found.append((section["ids"][0], title.astext(), passage(section)))
    return found


def note(app: Sphinx, doctree: nodes.document, docname: str) -> None:
    """Keep a page's headings and passages until all pages are written."""
    if app.builder.name == "html":
        part = Path(app.doctreedir, PARTS, f"{docname.replace('/', '-')}.json")
        part.parent.mkdir(parents=True, exist_ok=True)
        part.write_text(json.dumps([docname, sections(doctree)]), encoding="utf8")


def phrases(folder: Path) -> dict[str, list[str]]:
    """Return, by page, what it is looked for by, from ``book/search.toml`` below a folder."""
    table = tomllib.loads((folder / "book" / "search.toml").read_text(encoding="utf8"))
    known: dict[str, list[str]] = table["phrases"]
    return known


def write(app: Sphinx, exception: Exception | None) -> None:
    """Write the script from what all pages said."""
    if exception is not None or app.builder.name != "html":
        return
    known = phrases(Path(app.srcdir))
    toc = contents(Path(app.srcdir) / "_toc.yml")
    parts = sorted(Path(app.doctreedir, PARTS).glob("*.json"))
    said = dict(json.loads(part.read_text(encoding="utf8")) for part in parts)
    pages = [
        [
            name,
            app.env.titles[name].astext(),
            toc.kind(name.rpartition("/")[2]),
            known.get(name, []),
            said[name],
        ]
        for name in sorted(said)
        if name in app.env.found_docs
    ]
    text = f"window.inboundsPages = {json.dumps(pages, ensure_ascii=False, separators=(',', ':'))};\n"
    Path(app.outdir, "_static", SCRIPT).write_text(text, encoding="utf8")


def load(
    app: Sphinx, pagename: str, templatename: str, context: dict[str, Any], doctree: nodes.document | None
) -> None:
    """Load it on the search page, and nowhere else."""
    if pagename == "search":
        for name in (SCRIPT, "search.js"):  # after Sphinx's own scripts, before the page is ready
            app.add_js_file(name, loading_method="defer", priority=900)


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the handlers (called by Sphinx)."""
    app.connect("doctree-resolved", note, priority=900)  # when glued numbers are in place
    app.connect("html-page-context", load)
    app.connect("build-finished", write)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
