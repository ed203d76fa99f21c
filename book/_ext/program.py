"""A chapter's program on its page: ``{program-listing}`` and ``{program-diff}``.

* ``{program-listing}``: the program as one file, to download, and its listing, folded.
* ``{program-diff}``: what the chapter changes in the program that it continues, block by block.

Both are assembled from the cells of the page on which the directive stands (`inbounds.book.pages.programs`), so that
nothing stands twice; the files lie in ``_static/programs``.
"""

from pathlib import Path
from typing import Any

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from inbounds.book.pages.programs import assemble, diff, has_program

FOLDER = "programs"


class Program(SphinxDirective):
    """The download and the listing of the page's own program."""

    def run(self) -> list[nodes.Node]:
        """Parse the generated Markdown in place."""
        name = self.env.docname.rpartition("/")[2]
        notebook = Path(self.env.srcdir) / f"{self.env.docname}.ipynb"
        up = "../" * self.env.docname.count("/")
        link = nodes.raw(
            "",
            f'<p><a href="{up}_static/{FOLDER}/{name}.py" download>Download <code>{name}.py</code></a></p>',
            format="html",
        )
        listing = ["::::{dropdown} The whole program", "```{code-block} python"]
        listing += [*assemble(notebook).splitlines(), "```", "::::"]
        return [link, *parsed(self, listing)]


class Change(SphinxDirective):
    """What the page changes in the program so far."""

    def run(self) -> list[nodes.Node]:
        """Parse the generated Markdown in place."""
        notebook = Path(self.env.srcdir) / f"{self.env.docname}.ipynb"
        return parsed(self, ["```{code-block} diff", *diff(notebook).splitlines(), "```"])


def parsed(directive: SphinxDirective, markdown: list[str]) -> list[nodes.Node]:
    """Return what generated Markdown becomes at the place of a directive."""
    container = nodes.container()
    directive.state.nested_parse(StringList(markdown, source="program"), directive.content_offset, container)
    return container.children


def write_programs(app: Sphinx, exception: Exception | None) -> None:
    """Put the files into the built book."""
    if exception is None and app.builder.format == "html":
        target = Path(app.outdir) / "_static" / FOLDER
        target.mkdir(parents=True, exist_ok=True)
        for docname in sorted(app.env.found_docs):
            notebook = Path(app.srcdir) / f"{docname}.ipynb"
            if notebook.is_file() and has_program(notebook):
                (target / f"{notebook.stem}.py").write_text(assemble(notebook), encoding="utf8")


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directive (called by Sphinx)."""
    app.add_directive("program-listing", Program)
    app.add_directive("program-diff", Change)
    app.connect("build-finished", write_programs)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
