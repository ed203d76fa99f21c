"""The directive ``{course} N``: a course of four or eight sessions, from the folds *Teach it* of the chapters."""

from pathlib import Path

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from inbounds.book.pages.plans import COURSE, course


class Course(SphinxDirective):
    """A course, session by session."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Parse the generated Markdown in place."""
        notebooks = Path(self.env.srcdir) / "notebooks"
        for chapter in COURSE:
            self.env.note_dependency(str(notebooks / f"{chapter}.ipynb"))
        container = nodes.container()
        lines = StringList(
            "\n".join(course(int(self.arguments[0]), notebooks)).splitlines(), source="the folds Teach it"
        )
        self.state.nested_parse(lines, self.content_offset, container)
        return container.children


def setup(app: Sphinx) -> dict[str, object]:
    """Register the directive (called by Sphinx)."""
    app.add_directive("course", Course)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
