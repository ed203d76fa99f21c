"""Scripts and styles of the study's elements: the built book's pages load scripts once, a notebook carries its own.

An element of the class `name` is made live by the last of `SCRIPTS[name]`, and styled by the `.css` beside that.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from pathlib import Path

from inbounds.book.building import builds_the_book
from inbounds.book.drawing.variables import color_variables

_HERE = Path(__file__).parent
_PAGE = _HERE / "page.js"

SCRIPTS: Mapping[str, tuple[Path, ...]] = {
    "inbounds-study-explorer": (_PAGE, _HERE / "explorer.js"),
    "inbounds-picked-seeds": (_HERE.parent / "explorables" / "numerics.js", _PAGE, _HERE / "picked_seeds.js"),
    "inbounds-claims": (_PAGE, _HERE / "claims.js"),
}
"""Class of an element → the scripts it needs, in the order in which a page loads them."""

_COLORS = {
    "light": {"ink": "#22272d", "line": "#5f6770", "grid": "#dfe3e8", "focus": "#9a5b00", "page": "#ffffff"},
    "dark": {"ink": "#ced6dd", "line": "#9ca4af", "grid": "#364150", "focus": "#ffd394", "page": "#14181e"},
}


def carried_scripts(name: str) -> str:
    """Return the text of an element's scripts, empty where the book's build brings them.

    Example:
        >>> carried_scripts("inbounds-claims").count("inbounds.page = ")
        1
    """
    return "" if builds_the_book() else "\n".join(path.read_text(encoding="utf-8") for path in SCRIPTS[name])


@functools.cache
def style_sheet(name: str) -> str:
    """Return an element's style, led by the colours of text, lines and families, for both themes, where it has any.

    Example:
        >>> "--explorer-beta: #1F8277" in style_sheet("inbounds-study-explorer")
        True
    """
    style = SCRIPTS[name][-1].with_suffix(".css").read_text(encoding="utf-8")
    if "var(--explorer-" not in style:
        return style
    return "\n".join([color_variables(f".{name}", "explorer", _COLORS), style])


__all__ = ["SCRIPTS", "carried_scripts", "style_sheet"]
