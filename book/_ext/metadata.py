"""What other programs read of a page: its description, its preview, and a page for addresses that do not exist.

* Each page describes itself by its first paragraph of plain words, a chapter by its question; a page without one by
  the book's `description` (in ``_config.yml``).
* OpenGraph has title, description and, where ``html.baseurl`` gives the site's address, address and picture: both must
  be absolute. ``tools/social_picture.py`` draws the picture.
* ``404.html`` is what hosts send for a wrong address, at any depth: a ``<base>`` leads its links to the book.
* ``index.html`` redirects to the first page, and describes it.
"""

import html
import re
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.config import Config

LONGEST = 200  # characters of a description; services cut at about that
PICTURE = "social.png"
PICTURE_SIZE = (1200, 630)
PICTURE_ALT = "In Bounds: densities of logit-normal policies between the two bounds of an action"
NOT_FOUND = "404"
NOT_FOUND_BODY = """<section id="page-not-found"><h1>There is no such page</h1>
<p>The address may have been mistyped, or the page has moved.
Start at the <a href="{first}">first page</a>, or <a href="{search}">search the book</a>.</p></section>"""
# Without the site's address: the book is what holds the last of its own folders in the address, else the page's folder.
GUESSED_BASE = """<script>
      const inside = location.pathname.match(/^(.*\\/)(?:book|notebooks|_static|_sources)\\//);
      document.write(`<base href="${inside ? inside[1] : location.pathname.replace(/[^\\/]*$/, "")}">`);
    </script>"""


def shorten(text: str) -> str:
    """Return a text on one line, cut behind a word where it is too long."""
    words = textwrap.shorten(text, LONGEST, placeholder="…", break_on_hyphens=False)
    return words if words == " ".join(text.split()) else words.removesuffix("…").rstrip(",;:") + "…"


def is_plain(paragraph: nodes.paragraph) -> bool:
    """Return whether a paragraph has no formula, and nothing that could not be read."""
    return not any(paragraph.findall(lambda node: isinstance(node, nodes.math | nodes.problematic)))


def first_words(doctree: nodes.document | None) -> str:
    """Return the first paragraph of a page that is plain words, or nothing."""
    if doctree is None:
        return ""
    for paragraph in doctree.findall(nodes.paragraph):
        in_text = isinstance(paragraph.parent, nodes.section | nodes.document)
        if is_plain(paragraph) and in_text and paragraph.astext().strip():
            return paragraph.astext()
    return ""


def tags(config: Config, title: str, description: str, url: str) -> str:
    """Return the tags of a page; the address of its site is in `config`, `url` is the page's own or empty."""
    open_graph = {
        "type": "article",
        "site_name": config.html_title,
        "title": title,
        "description": description,
    }
    if config.html_baseurl:
        site = config.html_baseurl.rstrip("/")
        width, height = map(str, PICTURE_SIZE)
        open_graph |= {"url": url, "image": f"{site}/_static/{PICTURE}", "image:alt": PICTURE_ALT}
        open_graph |= {"image:width": width, "image:height": height}
    lines = [f'<meta name="description" content="{html.escape(description)}" />']
    lines += [f'<meta property="og:{k}" content="{html.escape(v)}" />' for k, v in open_graph.items() if v]
    if config.html_baseurl:
        lines.append('<meta name="twitter:card" content="summary_large_image" />')
    return "\n    ".join(lines)


def describe(
    app: Sphinx, pagename: str, templatename: str, context: dict[str, Any], doctree: nodes.document | None
) -> None:
    """Add the tags to a page."""
    description = shorten(first_words(doctree) or app.config.book_description)
    title = html.unescape(re.sub(r"<[^>]*>", "", context.get("title") or app.config.html_title))
    if pagename == NOT_FOUND:
        site = app.config.html_baseurl.rstrip("/")
        base = f'<base href="{html.escape(site)}/" />' if site else GUESSED_BASE
        context["metatags"] = f'\n    {base}\n    <meta name="robots" content="noindex" />'
    else:
        context["metatags"] = (
            context.get("metatags", "")
            + "\n    "
            + tags(app.config, title, description, context["pageurl"] or "")
        )


def page_not_found(app: Sphinx) -> Iterator[tuple[str, dict[str, Any], str]]:
    """Yield the page for addresses that do not exist."""
    links = {
        "first": app.builder.get_relative_uri(NOT_FOUND, app.config.root_doc),
        "search": app.builder.get_relative_uri(NOT_FOUND, "search"),
    }
    body = NOT_FOUND_BODY.format(**links)
    yield NOT_FOUND, {"title": "There is no such page", "body": body}, "page.html"


def write_index(app: Sphinx, exception: Exception | None) -> None:
    """Write the redirect to the first page, so that a link to the site itself has a preview, too."""
    if exception is not None or app.builder.name != "html":
        return
    first = app.builder.get_target_uri(app.config.root_doc)
    title = app.env.titles[app.config.root_doc].astext()
    url = app.config.html_baseurl
    described = tags(app.config, title, shorten(app.config.book_description), url)
    Path(app.outdir, "index.html").write_text(
        f"""<!DOCTYPE html>
<html lang="{app.config.language}">
  <head>
    <meta charset="utf-8" />
    <meta http-equiv="Refresh" content="0; url={first}" />
    <title>{html.escape(title)}</title>
    {described}
  </head>
  <body><a href="{first}">{html.escape(title)}</a></body>
</html>
""",
        encoding="utf-8",
    )


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the handlers (called by Sphinx)."""
    app.add_config_value("book_description", "", "html", str)
    app.connect("html-page-context", describe)
    app.connect("html-collect-pages", page_not_found)
    app.connect("build-finished", write_index)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
