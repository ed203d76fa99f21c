"""What a page shows as HTML, and a stored notebook keeps as a few words that no new measurement changes."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Shown:
    """Something that a page shows as HTML, and whose text form only says what it is."""

    what: str
    """In a few words, without numbers."""
    html: str

    def __repr__(self) -> str:
        return f"<{self.what}>"

    def _repr_html_(self) -> str:
        return f'<div style="overflow-x:auto">{self.html}</div>'
