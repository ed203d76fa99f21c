"""The directive ``how-to-cite`` shows ``CITATION.cff`` as BibTeX, with ``html.baseurl`` as address if it is given."""

from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from inbounds.book.pages.citing import bibtex

KIND = "how-to-cite"


class HowToCite(SphinxDirective):
    """An empty block, to be filled when the page is written: the address may have changed since it was read."""

    def run(self) -> list[nodes.Node]:
        """Return the block (called by docutils)."""
        self.env.note_dependency(str(Path(self.env.srcdir) / "CITATION.cff"))
        return [nodes.literal_block("", "", language="bibtex", classes=[KIND])]


def fill(app: Sphinx, doctree: nodes.document, docname: str) -> None:
    """Write the entry into its block."""
    for block in doctree.findall(nodes.literal_block):
        if KIND in block["classes"]:
            text = bibtex(Path(app.srcdir) / "CITATION.cff", app.config.html_baseurl)
            block.children = [nodes.Text(text)]
            block.rawsource = text


def setup(app: Sphinx) -> dict[str, Any]:
    """Register directive and handler (called by Sphinx)."""
    app.add_directive(KIND, HowToCite)
    app.connect("doctree-resolved", fill)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
