"""HTML from the templates beside this file: Jinja2 escapes every text that is not declared to be HTML."""

from __future__ import annotations

import functools
import json
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).with_suffix("")


def script_json(value: Any) -> str:
    r"""Return a value as JSON that may stand in a script: nothing in it ends the script's element.

    Example:
        >>> script_json({"a": "</script>", "µ": [1, 2]})
        '{"a":"<\\/script>","µ":[1,2]}'
    """
    return json.dumps(value, ensure_ascii=False, separators=(",", ":")).replace("</", "<\\/")


@functools.cache
def macros(name: str) -> Any:
    """Return the macros of a template, as functions of texts that return HTML.

    Args:
        name: of a file in `templates`, without its suffix.

    Example:
        >>> str(macros("report").paragraph("x < y"))
        '<p>x &lt; y</p>'
    """
    import jinja2  # what only writes films to files has no need of it

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(FOLDER),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    return environment.get_template(f"{name}.html").module
