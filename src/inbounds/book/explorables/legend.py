"""What a picture's marks mean, where no head of a table says it: the legend of an explorable.

::

    Mark("ring", "ink", "this policy", of=("here",))
"""

from __future__ import annotations

from dataclasses import dataclass

_SIGNS = {
    "line": '<path d="M0 7H32" stroke-width="2.5"/>',
    "thin": '<path d="M0 7H32" stroke-width="1.2"/>',
    "wide": '<path d="M0 7H32" stroke-width="6" opacity="0.4"/>',
    "dashed": '<path d="M0 7H32" stroke-width="2.5" stroke-dasharray="9 4"/>',
    "dotted": '<path d="M0 7H32" stroke-width="2.5" stroke-dasharray="2 4"/>',
    "upright": '<path d="M16 0V14" stroke-width="1.5"/>',
    "upright dotted": '<path d="M16 0V14" stroke-width="1.5" stroke-dasharray="2 2"/>',
    "ticks": '<path d="M7 14V6M13 14V6M19 14V6M25 14V6" stroke-width="1.5"/>',
    "ring": '<circle cx="16" cy="7" r="5.5" stroke-width="2.5"/>',
    "small ring": '<circle cx="16" cy="7" r="3" stroke-width="1.2"/>',
    "dot": '<circle cx="16" cy="7" r="4" fill="currentColor" stroke="none"/>',
    "diamond": '<path d="M16 0.5L21 7L16 13.5L11 7Z" stroke-width="2"/>',
    "oval": '<ellipse cx="16" cy="7" rx="14" ry="5.5" stroke-width="1.2"/>',
    "area": '<rect x="2" y="1" width="28" height="12" fill="currentColor" fill-opacity="0.3" stroke="none"/>',
    "band": '<rect x="2" y="1" width="28" height="12" fill="currentColor" stroke="none"/>',
    "bars": '<path d="M8 14V3M16 14V6M24 14V9" stroke-width="5" opacity="0.7"/>',
    "hatched": '<path d="M10 1H22V13H10ZM10 7L16 1M10 13L22 1M16 13L22 7" stroke-width="1.5"/>',
}
"""What a mark looks like, in a box of 32 by 14."""


@dataclass(frozen=True)
class Mark:
    """A kind of mark in the pictures, and what it means.

    Example:
        >>> Mark("ring", "ink", "this policy", of=("here",)).swatch()[:48]
        '<svg class="inbounds-sign" width="32" height="14'
    """

    sign: str
    """What it looks like: a key of `_SIGNS`."""
    color: str
    """A key of the explorable's `looks`, or one of the page's colours: ink, line, grid."""
    text: str
    """What it means, in a few words."""
    of: tuple[str, ...]
    """The data sources and spans that are drawn so, by name."""

    def swatch(self) -> str:
        """Return the mark as a small picture."""
        return (
            f'<svg class="inbounds-sign" width="32" height="14" viewBox="0 0 32 14" aria-hidden="true" fill="none" '
            f'stroke="currentColor" style="color: var(--inbounds-{self.color})">{_SIGNS[self.sign]}</svg>'
        )
