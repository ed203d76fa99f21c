"""What one change does: cells that differ in one thing from a cell of arm 1 (or 3), with which they are compared."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import compress

from matplotlib.figure import Figure

from inbounds.book.drawing.figures import LOOKS
from inbounds.book.report import html
from inbounds.book.report.html import NONE_FINISHED, Shown
from inbounds.book.report.study_figures import interval_note, interval_panels
from inbounds.book.report.words import HEADS, change_name
from inbounds.study import analysis
from inbounds.study.analysis import ENDPOINTS
from inbounds.study.grid import AFTERWARDS, ARMS, Cell
from inbounds.study.outcomes import Outcomes
from inbounds.study.statistics import Estimate
from inbounds.study.words import spoken

GROUPS = {
    "matched-noise": "Matched initial noise",
    "raw-cost": "Cost of raw actions",
    "entropy": "Entropy bonus",
    "gamma": "Discount 0.9999",
    "printed": "The two presets, one setting at a time",
}
"""First word of a variant → title."""


def changes(outcomes: Outcomes, word: str) -> Shown:
    """Return what one group of the fourth arm's variants changes, as a figure and tables.

    Args:
        outcomes: of the study.
        word: a key of `GROUPS`.
    """
    cells = [cell for cell in ARMS["mechanisms"] if cell.variant.startswith(word)]
    parts = _figure_and_tables(outcomes, GROUPS[word], cells)
    return html.of_study(f"what changes, {GROUPS[word].lower()}", *parts)


def afterwards(outcomes: Outcomes) -> Shown:
    """Return what the cells of `AFTERWARDS` change against those of arm 1, as a figure and tables."""
    parts = _figure_and_tables(outcomes.and_of(AFTERWARDS), "Initial noise, asked afterwards", AFTERWARDS)
    return html.of_study("what changes, asked afterwards", *parts)


def _figure_and_tables(outcomes: Outcomes, title: str, cells: Sequence[Cell]) -> list[str]:
    found: dict[str, dict[str, list[Estimate | None]]] = {}  # panel → family → endpoint by endpoint
    for cell in cells:
        outcome = outcomes.finished.get(cell.id)
        numbers = [analysis.change(outcomes, outcome, e) if outcome else None for e in ENDPOINTS]
        found.setdefault(_panel(cell), {})[cell.family] = numbers
    drawn = [f for f in LOOKS if any(row.get(f, [None])[0] for row in found.values())]
    panels = {
        panel: {family: numbers[0] for family, numbers in row.items() if family in drawn}
        for panel, row in found.items()
        if any(numbers[0] for numbers in row.values())
    }
    if not panels:
        return [NONE_FINISHED]

    def draw(narrow: bool) -> Figure:
        label = "change of the mean final return"
        return interval_panels(panels, xlabel=label, reference=0.0, narrow=narrow, noted=False)

    alt = f"{title}: change of the mean final return against the cell of comparison. " + ". ".join(
        f"{panel}: " + ", ".join(f"{LOOKS[f].label} {spoken(e)}" for f, e in row.items())
        for panel, row in panels.items()
    )
    # What all panels share is said once, in the captions.
    shared, names = _shared_and_names(panels)
    where = f"{title} ({', '.join(shared)})" if shared else title
    below = f"{where}: change of the mean final return, changed cell minus cell of comparison. {interval_note(panels)}"
    parts = [html.figure_of(draw, alt, below), *_tables(where, names, drawn, found)]
    counts = {panel: (sum(bool(n[0]) for n in row.values()), len(row)) for panel, row in found.items()}
    if any(done < planned for done, planned in counts.values()):
        shared, names = _shared_and_names(counts)
        parts.append(html.progress({names[panel] or shared[0]: count for panel, count in counts.items()}))
    return parts


def _tables(
    where: str,
    names: Mapping[str, str],
    drawn: Sequence[str],
    found: Mapping[str, Mapping[str, Sequence[Estimate | None]]],
) -> list[str]:
    """Return the final returns, a line each panel, and all endpoints in a fold; of one panel all at once."""
    every = {
        name: [[LOOKS[f].label, *map(spoken, numbers)] for f, numbers in found[panel].items() if numbers[0]]
        for panel, name in names.items()
    }
    caption = f"{where}: changed cell minus cell of comparison."
    whole = html.parted_table(caption, ["family", *HEADS.values()], every)
    if len(names) == 1:
        return [whole]
    parted = all(", " in name for name in names.values())  # by what they begin with, the robot
    lines: dict[str, list[list[str]]] = {}
    for panel, name in names.items():
        first, rest = name.split(", ", 1) if parted else ("", name)
        line = [spoken(found[panel][f][0]) if f in found[panel] else "" for f in drawn]
        lines.setdefault(first, []).append([rest, *line])
    head = ["changed", *(LOOKS[f].label for f in drawn)]
    final = html.parted_table(f"{where}: change of the mean final return.", head, lines)
    return [final, html.fold("Area and greedy return, too", whole)]


def _shared_and_names(panels: Iterable[str]) -> tuple[list[str], dict[str, str]]:
    """Return what the titles of all panels share; and the rest of each in one line, which may be nothing."""
    titles = {panel: panel.replace("\n", ", ").split(", ") for panel in panels}
    varies = [len(set(part)) > 1 for part in zip(*titles.values(), strict=True)]
    shared = [part for part, other in zip(next(iter(titles.values())), varies, strict=True) if not other]
    names = {panel: ", ".join(compress(parts, varies)) for panel, parts in titles.items()}
    return shared, names


def _panel(cell: Cell) -> str:
    """Return the title of a cell's panel: all that tells the group's cells apart but the family."""
    return f"{cell.robot}, {cell.algorithm.upper()}\n{change_name(cell.variant)}"
