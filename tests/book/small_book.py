"""A book of a few pages, built by Sphinx with the book's own extensions."""

import io
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx
from sphinx.util.docutils import docutils_namespace, patch_docutils

ROOT = Path(__file__).resolve().parents[2]
EXTENSIONS = ROOT / "book" / "_ext"


def build(folder: Path, settings: Mapping[str, Any], *, fresh: bool = True) -> str:
    """Build the pages of a folder into its html/, and return what the build complained of.

    Args:
        folder: which has an index, as a notebook or in Markdown.
        settings: of Sphinx, beside those of all such books.
        fresh: whether what an earlier build stored is forgotten.
    """
    said = io.StringIO()
    settings = {"nb_execution_mode": "off", **settings}
    sys.path.insert(0, str(EXTENSIONS))
    try:
        with patch_docutils(), docutils_namespace():
            app = Sphinx(
                folder,
                None,
                folder / "html",
                folder / "trees",
                "html",
                confoverrides=settings,
                status=None,
                warning=said,
                freshenv=fresh,
            )
            app.build()
    finally:
        sys.path.remove(str(EXTENSIONS))
    return said.getvalue()
