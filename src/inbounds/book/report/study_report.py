"""`inbounds study report`: everything that the finished cells say, on one page.

    write_report(Outcomes.read(StudyFolder()), Path("study-report.html"))

It works with no cell, with a few and with all of them: what is missing is called missing in its place.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

from inbounds.book.drawing.figures import LOOKS
from inbounds.book.report import html
from inbounds.book.report.arm_sections import HEADS, NONE_FINISHED, TITLES, arm_section
from inbounds.book.report.ledger_table import ledger_section
from inbounds.book.report.study_figures import interval_panels
from inbounds.book.report.words import spoken
from inbounds.learning.storage.whole_files import write_whole
from inbounds.study import analysis
from inbounds.study.analysis import ENDPOINTS
from inbounds.study.grid import AFTERWARDS, ARMS, ROBOTS, STUDY_VERSION, Cell
from inbounds.study.ledger import CLAIMS, judge
from inbounds.study.outcomes import Outcome, Outcomes
from inbounds.study.statistics import Estimate
from inbounds.study.statistics.settings import LEVEL, RESAMPLES
from inbounds.study.words import percent

HOW_TO_READ = (
    "A cell is one algorithm × family × variant × robot, ten seeds. The unit of analysis is the seed: n counts seeds.",
    f"Bars and bands are {percent(LEVEL)} intervals over seeds (expanded percentile bootstrap, {RESAMPLES} resamples); "
    "a curve's band holds at each epoch by itself, and over all robots the plain percentile interval is taken. They "
    "say what other seeds would have given, nothing about other robots.",
    "Differences are between families within an algorithm. p-values are of permutation tests, corrected over the six "
    "robots (Holm). An interval that contains 0 is unresolved: ten seeds a side find differences of about 1.3 standard "
    "deviations.",
    "Only whole cells count. One that is not finished is called missing, wherever it belongs.",
    "Final return, area and test were fixed before the first run, in results/PROTOCOL.md; the tables of what happened "
    "inside describe and decide nothing.",
)


def write_report(outcomes: Outcomes, path: Path) -> Path:
    """Write the report as one HTML file that needs no other.

    Args:
        outcomes: what there is of the study.
        path: of the file; its folder is made if missing.

    Returns:
        The path.

    Example:
        >>> import tempfile
        >>> from inbounds.study import StudyFolder
        >>> nothing = Outcomes.read(StudyFolder(Path("no/results")))
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     "Claims" in write_report(nothing, Path(folder) / "report.html").read_text()
        True
    """
    sections = [
        ("state", "What there is"),
        *TITLES.items(),
        ("afterwards", "Asked afterwards"),
        ("claims", "Claims of the source thesis"),
        ("provenance", "Provenance"),
    ]
    parts = [
        html.paragraph(f"Study version {STUDY_VERSION}. {_count(outcomes)}"),
        html.contents(sections),
        html.heading("How to read it", 3),
        html.bullets(HOW_TO_READ),
        html.heading("What there is", 2, "state"),
        *state_section(outcomes),
    ]
    for arm in TITLES:
        parts += _mechanisms(outcomes) if arm == "mechanisms" else arm_section(outcomes, arm)
    parts += [
        html.heading("Asked afterwards", 2, "afterwards"),
        html.paragraph(
            "Cells that the protocol does not have, added when results had been seen: exploratory. "
            "results/AFTERWARDS.md says why each was added, and what was expected."
        ),
        *afterwards(outcomes),
        html.heading("Claims of the source thesis", 2, "claims"),
        *ledger_section([judge(outcomes, c) for c in CLAIMS]),
    ]
    parts += [html.heading("Provenance", 2, "provenance"), *provenance_section(outcomes)]
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, html.page("In Bounds: the study", parts).encode())
    return path


def _count(outcomes: Outcomes) -> str:
    return f"{len(outcomes.finished)} of {len(outcomes.states)} cells are finished."


def state_section(outcomes: Outcomes) -> list[str]:
    """Return which cells are finished."""
    rows = []
    for arm, cells in ARMS.items():
        counts = [Counter(outcomes.states.get(c.id) for c in cells if c.robot == robot) for robot in ROBOTS]
        rows.append([TITLES[arm], *(f"{c['finished']} of {c.total()}" if c.total() else "–" for c in counts)])
    parts = [html.table("Finished cells of those planned, per robot.", ["arm", *ROBOTS], rows)]
    wrong = [
        f"{name}: {state}" for name, state in outcomes.states.items() if state not in ("finished", "missing")
    ]
    if wrong:
        parts += [html.paragraph("Not used, because they are not what they should be:"), html.bullets(wrong)]
    return parts


# ---- arm 4

GROUPS = {
    "matched-noise": "Matched initial noise",
    "raw-cost": "Cost of raw actions",
    "entropy": "Entropy bonus",
    "gamma": "Discount 0.9999",
    "printed": "The two presets, one factor at a time",
}
"""First word of a variant → title."""


def _mechanisms(outcomes: Outcomes) -> list[str]:
    parts = [html.heading(TITLES["mechanisms"], 2, "mechanisms")]
    said = (
        "Each cell differs in one thing from a cell of arm 1 (or 3), with which it is compared: difference of means, "
        f"with a {percent(LEVEL)} bootstrap interval, robot by robot, without a test and without a claim over robots."
    )
    parts.append(html.paragraph(said))
    for word, title in GROUPS.items():
        parts += [html.heading(title, 3), *changes(outcomes, word)]
    return parts


def changes(outcomes: Outcomes, word: str) -> list[str]:
    """Return what one group of the fourth arm's variants changes, as a figure and a table.

    Args:
        outcomes: what there is of the study.
        word: a key of `GROUPS`.
    """
    cells = [cell for cell in ARMS["mechanisms"] if cell.variant.startswith(word)]
    if not any(cell.id in outcomes.finished for cell in cells):
        return [NONE_FINISHED]
    return _changes(outcomes, GROUPS[word], cells)


def afterwards(outcomes: Outcomes) -> list[str]:
    """Return what the cells of `AFTERWARDS` change against those of arm 1, as a figure and a table."""
    both = outcomes.and_of(AFTERWARDS)
    if not any(cell.id in both.finished for cell in AFTERWARDS):
        return [NONE_FINISHED]
    return _changes(both, "Initial noise, asked afterwards", AFTERWARDS)


def _changes(outcomes: Outcomes, title: str, cells: Sequence[Cell]) -> list[str]:
    panels: dict[str, dict[str, Estimate | None]] = {}
    names, rows = [], []
    for cell in cells:
        outcome = outcomes.finished.get(cell.id)
        found = {e: analysis.change(outcomes, outcome, e) if outcome else None for e in ENDPOINTS}
        panels.setdefault(_panel(cell), {})[cell.family] = found["final"]
        if found["final"] is not None:
            names.append((cell.robot, cell.algorithm.upper(), LOOKS[cell.family].label, cell.variant))
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
    fig = interval_panels(panels, xlabel="change of the mean final return", reference=0.0)
    alt = f"{title}: change of the mean final return against the cell of comparison. " + ". ".join(
        f"{panel}: " + ", ".join(f"{LOOKS[f].label} {spoken(e)}" for f, e in row.items())
        for panel, row in panels.items()
    )
    # What all rows share is said once, in the caption: the table is wide enough.
    columns = dict(zip(("robot", "algorithm", "family", "variant"), zip(*names, strict=True), strict=True))
    told = {name: column for name, column in columns.items() if len(set(column)) > 1 or len(rows) == 1}
    shared = [column[0] for name, column in columns.items() if name not in told]
    where = f"{title} ({', '.join(shared)})" if shared else title
    caption = f"{where}: changed cell minus cell of comparison."
    table = [[*name, *row] for name, row in zip(zip(*told.values(), strict=True), rows, strict=True)]
    head = [*told, *HEADS.values()]
    parts = [html.figure(fig, alt, ""), html.table(caption, head, table, range(len(told)))]
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
    """What a panel is called: all that tells the group's cells apart but the family."""
    return f"{cell.robot}, {cell.algorithm.upper()}\n{cell.variant}"


# ---- provenance


def provenance_section(outcomes: Outcomes) -> list[str]:
    """Return what the finished cells ran on, and what they cost."""
    if not outcomes.finished:
        return [html.paragraph("missing: no cell is finished.", "missing")]
    parts = Counter(_ran_on(part) for o in outcomes.finished.values() for part in o.metadata["sessions"])
    # Versions and processor are long, and few: each pair has a number, which a list below the table explains.
    used = Counter(ran[2:] for ran in parts.elements())
    place = {pair: str(number) for number, (pair, _) in enumerate(used.most_common(), 1)}
    rows = [[str(count), *key[:2], place[key[2:]]] for key, count in parts.items()]
    caption = (
        "What the cells ran on. A cell that was stopped and resumed has several parts; + after a commit: the engine "
        "differed from it. Machines, with their versions, are listed below."
    )
    where = html.bullets(f"{number}: {'; '.join(pair)}" for pair, number in place.items())
    cost = html.paragraph(_cost(list(outcomes.finished.values())))
    return [html.table(caption, ["parts", "commit", "engine", "machine"], rows, (1, 2, 3)), where, cost]


def _ran_on(part: dict[str, object]) -> tuple[str, str, str, str]:
    """Return commit, engine, versions and processor of a part."""
    versions = part["versions"]
    assert isinstance(versions, dict)
    said = ", ".join(f"{name} {version}" for name, version in versions.items())
    return str(part["commit"])[:10], str(part["engine"])[:10], said, str(part["processor"])


def _cost(found: list[Outcome]) -> str:
    seconds = Counter[str]()
    for outcome in found:
        seconds.update(outcome.metadata["seconds"])
    training, evaluation = seconds["training"], seconds["evaluation"] + seconds["final evaluation"]
    rest = seconds["total"] - training - evaluation
    return (
        f"Engine: {training / 3600:.1f} h of wall time; evaluation {percent(evaluation / training, 1)} of that, "
        f"the runner itself {percent(rest / training, 1)}."
    )
