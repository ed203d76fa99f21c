"""The title of an exercise says that `inbounds grade` judges it, where the notebook calls a grader below it."""

import re
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx

from inbounds.book.pages.graded import graders_of

MARK = '<span aria-hidden="true">&nbsp;·</span> <span class="graded">graded by <code>inbounds grade</code></span>'


def marked(body: str, labels: list[str]) -> str:
    """Return a page's HTML with the mark at the end of the titles of some exercises, given by label."""
    for label in labels:
        title = re.compile(
            rf'(<div class="[^"]*\bexercise\b[^"]*" id="{re.escape(label)}">\s*<p class="admonition-title">.*?)</p>',
            re.S,
        )
        body, count = title.subn(rf"\1{MARK}</p>", body)
        if count != 1:
            raise ValueError(f"the exercise {label} has a grader and no title to say so")
    return body


def mark(
    app: Sphinx, pagename: str, templatename: str, context: dict[str, Any], doctree: nodes.document | None
) -> None:
    """Mark a page's exercises."""
    notebook = Path(app.srcdir) / f"{pagename}.ipynb"
    if pagename.startswith("notebooks/") and doctree is not None and notebook.is_file():
        labels = [label for label, graders in graders_of(notebook).items() if graders]
        context["body"] = marked(context["body"], labels)


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the handler (called by Sphinx)."""
    app.connect("html-page-context", mark)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
