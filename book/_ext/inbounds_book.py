"""The book's own Sphinx extension: no page asks another host for anything, and each loads only what it uses.

* sphinx-thebe's scripts are dropped. Jupyter Book 1.x puts them on every page, even with thebe off, where they
  throw ``THEBE_JS_URL has already been declared``.
* BokehJS is copied from the installed bokeh package and loaded on the pages that show an explorable.
* The execution cache's folder is named by ``tools/build_book.py`` (a digest of package, data and pins).
"""

import os
import shutil
from pathlib import Path
from typing import Any

import bokeh
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.config import Config

from inbounds.book import explorables

BOKEH_JS = Path(bokeh.__file__).parent / "server" / "static" / "js"
EXPLORABLE = 'class="inbounds-explorable"'


def use_named_cache(app: Sphinx, config: Config) -> None:
    """Let the build tool choose the execution cache."""
    if "INBOUNDS_NB_CACHE" in os.environ:
        config.nb_execution_cache_path = os.environ["INBOUNDS_NB_CACHE"]


def copy_bokeh(app: Sphinx, exception: Exception | None) -> None:
    """Serve BokehJS from the book itself."""
    if exception is None and app.builder.format == "html":
        target = Path(app.outdir) / "_static" / "bokeh"
        target.mkdir(parents=True, exist_ok=True)
        for name in explorables.BOKEH_JS_FILES:
            shutil.copy2(BOKEH_JS / name, target / name)


def choose_scripts(
    app: Sphinx, pagename: str, templatename: str, context: dict[str, Any], doctree: nodes.document | None
) -> None:
    """Drop thebe's scripts from every page; add BokehJS to the pages that need it."""
    context["script_files"] = [script for script in context["script_files"] if not is_thebe(script)]
    if EXPLORABLE in context.get("body", ""):
        for name in explorables.BOKEH_JS_FILES:
            app.add_js_file(f"bokeh/{name}", priority=400)


def is_thebe(script: Any) -> bool:
    """Whether a script tag comes from sphinx-thebe: its file, or its inline settings."""
    attributes = getattr(script, "attributes", {})
    return "thebe" in str(getattr(script, "filename", "")) or "THEBE_JS_URL" in (attributes.get("body") or "")


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the handlers (called by Sphinx)."""
    app.connect("config-inited", use_named_cache, priority=100)
    app.connect("html-page-context", choose_scripts, priority=900)
    app.connect("build-finished", copy_bokeh)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
