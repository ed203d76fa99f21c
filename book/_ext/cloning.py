"""The directive ``how-to-clone``: the command that fetches the repository of ``_config.yml``."""

from pathlib import Path
from typing import Any

import yaml
from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from inbounds.book.pages.citing import cloning


class HowToClone(SphinxDirective):
    """The command, and a sentence where the address is still a placeholder."""

    def run(self) -> list[nodes.Node]:
        """Parse the generated Markdown in place (called by docutils)."""
        config = Path(self.env.srcdir) / "_config.yml"
        self.env.note_dependency(str(config))
        url = yaml.safe_load(config.read_text(encoding="utf8"))["repository"]["url"]
        container = nodes.container()
        self.state.nested_parse(
            StringList(cloning(url), source="_config.yml"), self.content_offset, container
        )
        return container.children


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directive (called by Sphinx)."""
    app.add_directive("how-to-clone", HowToClone)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
