"""The study as the book shows it: the parts of `inbounds study report`, one at a time.

    outcomes = study_pages.shipped()
    study_pages.curves(outcomes, "printed", "ppo")

The text form of what is shown holds no number: a stored notebook stays the same when another cell arrives.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import closing
from pathlib import Path

import gymnasium
import numpy as np

from inbounds.book.drawing.figures import LOOKS
from inbounds.book.drawing.videos import show_films
from inbounds.book.report import arm_sections as report_arms
from inbounds.book.report import html, study_report
from inbounds.book.report import ledger_table as report_ledger
from inbounds.book.report import score_tables as report_results
from inbounds.book.report.aggregates import aggregates, columns_of
from inbounds.book.report.arm_sections import Cells
from inbounds.book.report.html_output import Shown
from inbounds.learning import load_policy
from inbounds.robots import Film, record
from inbounds.study.ledger import CLAIMS, Finding, judge
from inbounds.study.outcomes import Outcome, Outcomes
from inbounds.study.store import ROOT, StudyFolder


def shipped(root: Path = ROOT) -> Outcomes:
    """Read the study that the project ships; each file is compared with its checksum.

    Args:
        root: of the source tree.

    Raises:
        FileNotFoundError: there are no results: the package was installed without its source tree.
    """
    return Outcomes.read(StudyFolder.shipped(root))


def state(outcomes: Outcomes) -> Shown:
    """Return which cells are finished."""
    return _shown("study: finished cells", study_report.state_section(outcomes))


def provenance(outcomes: Outcomes) -> Shown:
    """Return what the finished cells ran on, and what they cost."""
    return _shown("study: provenance", study_report.provenance_section(outcomes))


def curves(outcomes: Outcomes, arm: str, algorithm: str) -> Shown:
    """Return the learning curves of an arm under an algorithm, a panel per robot."""
    return _of_arm("learning curves", outcomes, arm, algorithm, report_arms.curves)


def endpoints(outcomes: Outcomes, arm: str, algorithm: str) -> Shown:
    """Return final returns as a figure, and all endpoints as a table."""
    return _of_arm("endpoints", outcomes, arm, algorithm, report_arms.endpoints)


def difference_table(outcomes: Outcomes, arm: str, algorithm: str) -> Shown:
    """Return the differences between families: final returns as a figure, all endpoints as a table with tests."""

    def parts(_: str, cells: Cells) -> list[str]:
        found = report_arms.difference_table(outcomes, arm, algorithm)
        return found + report_arms.without_diverged(outcomes, arm, algorithm, cells)

    return _of_arm("differences", outcomes, arm, algorithm, parts)


def inside(outcomes: Outcomes, arm: str, algorithm: str) -> Shown:
    """Return the table of what happened inside: noise, saturation, clamps, KL, entropy."""
    return _of_arm(
        "inside", outcomes, arm, algorithm, lambda title, cells: [report_arms.diagnostics(title, cells)]
    )


def over_all_robots(outcomes: Outcomes, arm: str) -> Shown:
    """Return IQM, probability of improvement and profiles over all robots."""
    title = report_arms.TITLES[arm].partition(": ")[2]
    return _shown(f"study: over all robots, {title}", aggregates(outcomes, arm, title)[1:])


def ways(outcomes: Outcomes) -> Shown:
    """Return the returns of the final policies by way to act."""
    found = report_arms.ways(outcomes, "standard")
    return _shown("study: ways to act", found or [html.paragraph("missing: no cell is finished.", "missing")])


def changes(outcomes: Outcomes, word: str) -> Shown:
    """Return what a group of the fourth arm's variants changes; `word` is a key of `study_report.GROUPS`."""
    return _shown(
        f"study: what changes, {study_report.GROUPS[word].lower()}", study_report.changes(outcomes, word)
    )


def afterwards(outcomes: Outcomes) -> Shown:
    """Return what the cells outside the protocol change (`results/AFTERWARDS.md`)."""
    return _shown("study: what changes, asked afterwards", study_report.afterwards(outcomes))


def score_sheet(outcomes: Outcomes) -> Shown:
    """Return wins and losses after Holm, beside what the source thesis says."""
    return _shown("study: wins and losses", report_results.score_sheet(outcomes))


def found_differences(outcomes: Outcomes, arm: str) -> Shown:
    """Return every difference of an arm that some endpoint finds, with all endpoints."""
    title = report_arms.TITLES[arm].partition(": ")[2]
    return _shown(f"study: what is found, {title}", report_results.found_differences(outcomes, arm))


def published(outcomes: Outcomes) -> Shown:
    """Return published scores beside the study's."""
    return _shown("study: beside published scores", report_results.published(outcomes))


def films(outcomes: Outcomes, robot: str, algorithm: str = "ppo", seconds: float = 4.0) -> Shown:
    """Return films of the final policies of arm 1 on a robot, acting by the median, one family beside the other.

    Each family shows the seed whose policy has the middle return (of ten, the lower of the two in the middle).

    Args:
        outcomes: what there is of the study.
        robot: its name, as in `inbounds.study.grid.ROBOTS`.
        algorithm: ppo or trpo.
        seconds: of each film.
    """
    columns = columns_of("standard", algorithm)
    found = {f: outcome for f, c in columns.items() if (outcome := outcomes.find(c, robot)) is not None}
    parts = _side_by_side(outcomes, {LOOKS[f].label: o for f, o in found.items()}, seconds)
    lacking = [LOOKS[family].label for family in columns if family not in found]
    if lacking:
        parts.append(html.paragraph(f"missing, not finished: {', '.join(lacking)}.", "missing"))
    return _shown(f"films: {robot}, {algorithm.upper()}, one per family", parts)


def films_of(outcomes: Outcomes, chosen: Mapping[str, Outcome], seconds: float = 4.0) -> Shown:
    """Return films of chosen cells' final policies, as `films` shows those of one robot.

    Args:
        outcomes: where the cells were found.
        chosen: caption → cell; each must keep its policies.
        seconds: of each film.
    """
    return _shown(f"films: {', '.join(chosen)}", _side_by_side(outcomes, chosen, seconds))


def _side_by_side(outcomes: Outcomes, chosen: Mapping[str, Outcome], seconds: float) -> list[str]:
    shown = {_caption(name, o): _film(outcomes, o, seconds) for name, o in chosen.items()}
    return [show_films(shown)._repr_html_()] if shown else []


def middle_seed(outcome: Outcome) -> int:
    """Return the place of the seed whose final policy, acting by the median, has the middle return."""
    returns = outcome.ways["median"]
    return int(np.argsort(returns, kind="stable")[(np.isfinite(returns).sum() - 1) // 2])


def _caption(name: str, outcome: Outcome) -> str:
    seed = middle_seed(outcome)
    return f"{name}, seed {outcome.cell.seeds[seed]}: {outcome.ways['median'][seed]:.0f}"


def _film(outcomes: Outcomes, outcome: Outcome, seconds: float) -> Film:
    policy = load_policy(outcomes.folder.policy_files(outcome.cell)[0], middle_seed(outcome))
    with closing(gymnasium.make(policy.config.env)) as env:
        return record(env, lambda obs: policy.act(obs, greedy="median"), seconds=seconds, seed=0)


def findings(outcomes: Outcomes) -> list[Finding]:
    """Judge all claims of the source thesis."""
    return [judge(outcomes, claim) for claim in CLAIMS]


def ledger(found: list[Finding]) -> Shown:
    """Return the table of claims."""
    return _shown("study: the ledger", report_ledger.ledger_section(found))


def decided(found: list[Finding]) -> Shown:
    """Return the claims that are decided, with their numbers."""
    return _shown("study: what is decided", report_ledger.decided(found))


def _of_arm(
    what: str, outcomes: Outcomes, arm: str, algorithm: str, parts: Callable[[str, Cells], list[str]]
) -> Shown:
    title = report_arms.title_of(arm, algorithm)
    cells = report_arms.cells_of(outcomes, arm, algorithm)
    lacking = html.paragraph(f"missing ({what}): no cell of “{title}” is finished.", "missing")
    told = parts(title, cells) if report_arms.any_finished(cells) else [lacking]
    return _shown(f"study: {what}, {title}", told)


def _shown(what: str, parts: list[str]) -> Shown:
    return Shown(what, "\n".join(['<div class="inbounds-study">', *parts, "</div>"]))
