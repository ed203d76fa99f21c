"""A line under a title says which kind the page is, core chapter or *Going deeper*, and how long it takes to read.

The kind comes from the table of contents, the minutes from a count of words and visible code: nobody types either.
"""

from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx

from inbounds.book.pages.contents import contents
from inbounds.book.pages.counts import count_page

KINDS = {"core": "Core chapter", "depth": "Going deeper"}
HOW = "150 words or 15 lines of visible code a minute; without formulas, exercises and Teach it"


def line(kind: str, minutes: int) -> str:
    """Return the line as HTML."""
    return (
        f'<p class="page-kind page-kind-{kind}"><span>{KINDS[kind]}</span> · '
        f'<span title="{HOW}">about {minutes} minute{"" if minutes == 1 else "s"} of reading</span></p>'
    )


def say_kind(
    app: Sphinx, pagename: str, templatename: str, context: dict[str, Any], doctree: nodes.document | None
) -> None:
    """Put the line behind the page's title."""
    folder, _, name = pagename.rpartition("/")
    toc = Path(app.srcdir) / "_toc.yml"
    kind = contents(toc).kind(name) if folder == "notebooks" and toc.is_file() else ""
    if kind and "</h1>" in context.get("body", ""):
        minutes = count_page(Path(app.srcdir) / f"{pagename}.ipynb").minutes()
        context["body"] = context["body"].replace("</h1>", f"</h1>\n{line(kind, minutes)}", 1)


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the handler (called by Sphinx)."""
    app.connect("html-page-context", say_kind)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
