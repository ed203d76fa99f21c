"""What one change does: cells that differ in one thing from a cell of arm 1 (or 3), with which they are compared."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

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
    "printed": "The two presets, one factor at a time",
}
"""First word of a variant → title."""


def changes(outcomes: Outcomes, word: str) -> Shown:
    """Return what one group of the fourth arm's variants changes, as a figure and a table.

    Args:
        outcomes: of the study.
        word: a key of `GROUPS`.
    """
    cells = [cell for cell in ARMS["mechanisms"] if cell.variant.startswith(word)]
    parts = _figure_and_table(outcomes, GROUPS[word], cells)
    return html.of_study(f"what changes, {GROUPS[word].lower()}", *parts)


def afterwards(outcomes: Outcomes) -> Shown:
    """Return what the cells of `AFTERWARDS` change against those of arm 1, as a figure and a table."""
    parts = _figure_and_table(outcomes.and_of(AFTERWARDS), "Initial noise, asked afterwards", AFTERWARDS)
    return html.of_study("what changes, asked afterwards", *parts)


def _figure_and_table(outcomes: Outcomes, title: str, cells: Sequence[Cell]) -> list[str]:
    panels: dict[str, dict[str, Estimate | None]] = {}
    names: list[dict[str, str]] = []
    rows: list[list[str]] = []
    for cell in cells:
        outcome = outcomes.finished.get(cell.id)
        found = {e: analysis.change(outcomes, outcome, e) if outcome else None for e in ENDPOINTS}
        panels.setdefault(_panel(cell), {})[cell.family] = found["final"]
        if found["final"] is not None:
            names.append(
                {
                    "robot": cell.robot,
                    "algorithm": cell.algorithm.upper(),
                    "family": LOOKS[cell.family].label,
                    "change": change_name(cell.variant),
                }
            )
            rows.append([spoken(estimate) for estimate in found.values()])
    if not rows:
        return [NONE_FINISHED]
    counts = {panel: (sum(map(bool, row.values())), len(row)) for panel, row in panels.items()}
    drawn = {family for row in panels.values() for family, estimate in row.items() if estimate}
    panels = {
        panel: {family: estimate for family, estimate in row.items() if family in drawn}
        for panel, row in panels.items()
        if any(row.values())
    }

    def draw(narrow: bool) -> Figure:
        label = "change of the mean final return"
        return interval_panels(panels, xlabel=label, reference=0.0, narrow=narrow, noted=False)

    alt = f"{title}: change of the mean final return against the cell of comparison. " + ". ".join(
        f"{panel}: " + ", ".join(f"{LOOKS[f].label} {spoken(e)}" for f, e in row.items())
        for panel, row in panels.items()
    )
    # What all rows share is said once, in the caption: the table is wide enough.
    told = [name for name in names[0] if len(rows) == 1 or len({each[name] for each in names}) > 1]
    shared = [text for name, text in names[0].items() if name not in told]
    where = f"{title} ({', '.join(shared)})" if shared else title
    caption = f"{where}: changed cell minus cell of comparison."
    first, last = (
        [n for n in told if n != "change"],
        [n for n in told if n == "change"],
    )  # results stay in view
    table = [
        [*(each[name] for name in first), *row, *(each[name] for name in last)]
        for each, row in zip(names, rows, strict=True)
    ]
    head = [*first, *HEADS.values(), *last]
    words = [i for i, name in enumerate(head) if name in told]
    below = f"{where}: change of the mean final return, changed cell minus cell of comparison. {interval_note(panels)}"
    parts = [html.figure_of(draw, alt, below), html.table(caption, head, table, words)]
    if any(done < planned for done, planned in counts.values()):
        parts.append(html.progress(_without_shared(counts)))
    return parts


def _without_shared(counts: Mapping[str, tuple[int, int]]) -> dict[str, tuple[int, int]]:
    """Name panels in one line, by what does not hold for all of them."""
    names = [panel.replace("\n", ", ").split(", ") for panel in counts]
    told = [i for i, part in enumerate(zip(*names, strict=True)) if len(set(part)) > 1] or [0]
    return {
        ", ".join(name[i] for i in told): count for name, count in zip(names, counts.values(), strict=True)
    }


def _panel(cell: Cell) -> str:
    """Return the title of a cell's panel: all that tells the group's cells apart but the family."""
    return f"{cell.robot}, {cell.algorithm.upper()}\n{change_name(cell.variant)}"
