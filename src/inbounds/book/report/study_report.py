"""`inbounds study report`: everything that the finished cells say, on one page.

    write_report(Outcomes.read(StudyFolder()), Path("study-report.html"))

It works with no cell, with a few and with all of them: what is missing is called missing in its place.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

from inbounds.book.report import arms, html
from inbounds.book.report.changes import GROUPS, afterwards, changes
from inbounds.book.report.html import NONE_FINISHED, Shown
from inbounds.book.report.ledger_table import findings, ledger
from inbounds.book.report.over_all_robots import over_all_robots
from inbounds.book.report.second_study import second_study
from inbounds.book.report.words import ALGORITHMS, ARM_NAMES, ARM_TITLES, title_of
from inbounds.learning.storage.whole_files import write_whole
from inbounds.study.grid import ARMS, ROBOTS
from inbounds.study.outcomes import Outcome, Outcomes
from inbounds.study.statistics.settings import (
    CURVE_RESAMPLES,
    LEVEL,
    MANY_RESAMPLES,
    PROFILE_RESAMPLES,
    RESAMPLES,
)
from inbounds.study.words import percent

HOW_TO_READ = (
    "A cell is one algorithm × family × variant × robot, ten seeds. The unit of analysis is the seed: n counts seeds.",
    f"Bars and bands are {percent(LEVEL)} intervals over seeds: expanded percentile bootstrap, {MANY_RESAMPLES} "
    f"resamples, {CURVE_RESAMPLES} for a curve. A curve's band holds at each epoch by itself, and over all robots the "
    f"plain percentile interval is taken (first study: {RESAMPLES} resamples, {PROFILE_RESAMPLES} for a profile). They "
    "say what other seeds would have given, nothing about other robots.",
    "Differences are between families within an algorithm. p-values are of permutation tests, in the first study "
    "corrected over the six robots (Holm). An interval that contains 0 is unresolved: ten seeds a side find "
    "differences of about 1.3 standard deviations.",
    "Only whole cells count. One that is not finished is called missing, wherever it belongs.",
    "Final return, area and test were fixed before the first run, in results/PROTOCOL.md; the tables of what happened "
    "inside describe and decide nothing.",
)


def write_report(
    outcomes: Outcomes, path: Path, on_section: Callable[[str], object] = lambda title: None
) -> Path:
    """Write the report as one HTML file that needs no other.

    Args:
        outcomes: of the study.
        path: of the file; its folder is made if missing.
        on_section: called with the title of each section, before its figures are drawn; some minutes in all.

    Returns:
        The path.

    Example:
        >>> import tempfile
        >>> from pathlib import Path
        >>> from inbounds.study import StudyFolder
        >>> from inbounds.study.outcomes import Outcomes
        >>> nothing = Outcomes.read(StudyFolder(Path("no/results")))
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     "Claims" in write_report(nothing, Path(folder) / "report.html").read_text()
        True
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, html.page("In Bounds: the study", list(_body(outcomes, on_section))).encode())
    return path


def _body(outcomes: Outcomes, on_section: Callable[[str], object]) -> Iterator[str]:
    """Yield the parts of the page."""
    sections = {
        "state": "What there is",
        **ARM_TITLES,
        "afterwards": "Asked afterwards",
        "second": "The second study",
        "claims": "Claims of the source thesis",
        "provenance": "Provenance",
    }

    def heading(anchor: str) -> str:
        on_section(sections[anchor])
        return html.heading(sections[anchor], 2, anchor)

    finished = f"{len(outcomes.finished)} of {len(outcomes.states)} cells are finished."
    yield html.paragraph(f"{finished} The second study is counted in its own section.")
    yield html.contents(sections.items())
    yield html.heading("How to read it", 3)
    yield html.bullets(HOW_TO_READ)
    yield heading("state")
    yield from state(outcomes).parts
    for arm in ARM_TITLES:
        yield heading(arm)
        yield from _changed_cells(outcomes) if arm == "mechanisms" else _compared_families(outcomes, arm)
    yield heading("afterwards")
    yield html.paragraph(
        "Cells that the protocol does not have, added when results had been seen: exploratory. "
        "results/AFTERWARDS.md says why each was added, and what was expected."
    )
    yield from afterwards(outcomes).parts
    yield heading("second")
    yield from second_study(outcomes)
    yield heading("claims")
    yield from ledger(findings(outcomes)).parts
    yield heading("provenance")
    yield from provenance(outcomes).parts


def _compared_families(outcomes: Outcomes, arm: str) -> Iterator[str]:
    """Yield the parts of an arm that compares families; short where none of its cells is finished."""
    finished = [outcomes.finished[cell.id] for cell in ARMS[arm] if cell.id in outcomes.finished]
    if not finished:
        yield html.missing("missing: no cell of this arm is finished.")
        return
    for algorithm in ALGORITHMS:
        yield html.heading(title_of(arm, algorithm), 3)
        if not arms.Part.of(outcomes, arm, algorithm).begun:
            yield NONE_FINISHED
            continue
        for view in (arms.curves, arms.endpoints, arms.difference_table, arms.inside):
            yield from view(outcomes, arm, algorithm).parts
    yield html.heading(f"Over all robots, {ARM_NAMES[arm]}", 3)
    yield from over_all_robots(outcomes, arm).parts
    if any(outcome.ways for outcome in finished):
        yield html.heading("Ways to act", 3)
        yield from arms.ways(outcomes, arm).parts


def _changed_cells(outcomes: Outcomes) -> Iterator[str]:
    """Yield the parts of the arm that changes one thing at a time."""
    yield html.paragraph(
        "Each cell differs in one thing from a cell of arm 1 (or 3), with which it is compared: difference of means, "
        f"with a {percent(LEVEL)} bootstrap interval, robot by robot, without a test and without a claim over robots."
    )
    for word, title in GROUPS.items():
        yield html.heading(title, 3)
        yield from changes(outcomes, word).parts


def state(outcomes: Outcomes) -> Shown:
    """Return which cells are finished."""
    rows = []
    for arm, cells in ARMS.items():
        counts = [Counter(outcomes.states.get(c.id) for c in cells if c.robot == robot) for robot in ROBOTS]
        rows.append(
            [ARM_TITLES[arm], *(f"{c['finished']} of {c.total()}" if c.total() else "–" for c in counts)]
        )
    parts = [html.table("Finished cells of those planned, per robot.", ["arm", *ROBOTS], rows)]
    wrong = [
        f"{name}: {state}" for name, state in outcomes.states.items() if state not in ("finished", "missing")
    ]
    if wrong:
        parts += [html.paragraph("Not used, because they are not what they should be:"), html.bullets(wrong)]
    return html.of_study("finished cells", *parts)


def provenance(outcomes: Outcomes) -> Shown:
    """Return what the finished cells ran on, and what they cost."""
    if not outcomes.finished:
        return html.of_study("provenance", html.missing("missing: no cell is finished."))
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
    told = html.table(caption, ["parts", "commit", "engine", "machine"], rows, (1, 2, 3))
    return html.of_study("provenance", told, where, cost)


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
