"""Draw the rooms of the package, and which may import which: ``book/_static/rooms.svg``, for CONTRIBUTING.md.

    python tools/rooms_picture.py

What may be imported is said by ``tests/test_architecture.py``. An arrow that others imply is left out: a room may
import whatever can be reached from it.
"""

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TARGET = ROOT / "book" / "_static" / "rooms.svg"
WIDTH, HEIGHT = 128, 50  # of a room
PLACES = {
    "cli": (12, 86, "the command"),
    "book": (164, 86, "what pages show"),
    "study": (316, 86, "the experiment"),
    "learning": (468, 86, "what improves"),
    "integrations": (468, 14, "other libraries"),
    "distributions": (636, 14, "what draws actions"),
    "robots": (636, 158, "what executes them"),
}
"""Room → left, top, and what it is for."""
STYLE = """
  svg { font-family: system-ui, sans-serif; }
  .paper { fill: #ffffff; } .room { fill: #eef3f8; stroke: #4a6178; }
  text { fill: #1c2733; text-anchor: middle; } .name { font-size: 15px; font-weight: 600; } .what { font-size: 11.5px; }
  path { stroke: #4a6178; stroke-width: 1.6; fill: none; } marker path { fill: #4a6178; stroke: none; }
  @media (prefers-color-scheme: dark) {
    .paper { fill: #14181d; } .room { fill: #232c36; stroke: #9fb4c9; } text { fill: #e8eef4; }
    path { stroke: #9fb4c9; } marker path { fill: #9fb4c9; }
  }"""


def drawn(may_import: Mapping[str, set[str]]) -> list[tuple[str, str]]:
    """Return the arrows that no way through other rooms implies."""
    return [
        (room, other)
        for room, others in may_import.items()
        for other in sorted(others)
        if not any(other in may_import[between] for between in others)
    ]


def arrow(room: str, other: str) -> str:
    """Return the arrow from the right side of a room to the left side of another."""
    (left, top, _), (goal, height, _) = PLACES[room], PLACES[other]
    return (
        f'<path d="M{left + WIDTH} {top + HEIGHT // 2} L{goal - 3} {height + HEIGHT // 2}" '
        'marker-end="url(#tip)"/>'
    )


def picture(may_import: Mapping[str, set[str]]) -> str:
    """Return the SVG.

    Args:
        may_import: room → the rooms that it may import.
    """
    arrows = drawn(may_import)
    told = "; ".join(f"{room} imports {other}" for room, other in arrows)
    lines = [
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 776 222" width="776" height="222" role="img">',
        f"<title>The rooms of the package: {told}</title>",
        f"<style>{STYLE}\n</style>",
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" '
        'orient="auto"><path d="M0 0 L8 4 L0 8 z"/></marker></defs>',
        '<rect class="paper" width="776" height="222" rx="8"/>',
        *(arrow(*each) for each in arrows),
    ]
    for room in may_import:
        left, top, what = PLACES[room]
        middle = left + WIDTH // 2
        lines += [
            f'<rect class="room" x="{left}" y="{top}" width="{WIDTH}" height="{HEIGHT}" rx="6"/>',
            f'<text class="name" x="{middle}" y="{top + 21}">{room}</text>',
            f'<text class="what" x="{middle}" y="{top + 39}">{what}</text>',
        ]
    return "\n".join([*lines, "</svg>"]) + "\n"


def main() -> None:
    argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    ).parse_args()
    sys.path.insert(0, str(ROOT))
    from tests.test_architecture import MAY_IMPORT

    TARGET.write_text(picture(MAY_IMPORT), encoding="utf8")
    print(TARGET)


if __name__ == "__main__":
    main()
