"""The study as the book shows it: the parts of `inbounds study report`, one at a time.

    outcomes = study_pages.shipped()
    study_pages.curves(outcomes, "printed", "ppo")

The text form of what is shown holds no number: a stored notebook stays the same when another cell arrives.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import closing
from pathlib import Path

import gymnasium
import numpy as np

from inbounds.book.drawing.figures import LOOKS
from inbounds.book.drawing.videos import show_films
from inbounds.book.report import html
from inbounds.book.report.arms import columns_of, curves, difference_table, endpoints, inside, ways
from inbounds.book.report.changes import afterwards, changes
from inbounds.book.report.html import KIND, Shown
from inbounds.book.report.ledger_table import decided, findings, ledger
from inbounds.book.report.over_all_robots import over_all_robots
from inbounds.book.report.score_tables import found_differences, published, score_sheet
from inbounds.book.report.study_report import provenance, state
from inbounds.learning import load_policy
from inbounds.robots import Film, record
from inbounds.study.outcomes import Outcome, Outcomes
from inbounds.study.store import ROOT, StudyFolder

__all__ = [
    "afterwards",
    "changes",
    "curves",
    "decided",
    "difference_table",
    "endpoints",
    "films",
    "films_of",
    "findings",
    "found_differences",
    "inside",
    "ledger",
    "middle_seed",
    "over_all_robots",
    "provenance",
    "published",
    "score_sheet",
    "shipped",
    "state",
    "ways",
]


def shipped(root: Path = ROOT) -> Outcomes:
    """Read the study that the project ships; each file is compared with its checksum.

    Args:
        root: of the source tree.

    Raises:
        FileNotFoundError: there are no results: the package was installed without its source tree.
    """
    return Outcomes.read(StudyFolder.shipped(root))


def films(outcomes: Outcomes, robot: str, algorithm: str = "ppo", seconds: float = 4.0) -> Shown:
    """Return films of the final policies of arm 1 on a robot, acting by the median, one family beside the other.

    Each family shows the seed whose policy has the middle return (of ten, the lower of the two in the middle).

    Args:
        outcomes: of the study.
        robot: its name, as in `inbounds.study.grid.ROBOTS`.
        algorithm: ppo or trpo.
        seconds: of each film.
    """
    columns = columns_of("standard", algorithm)
    found = {f: outcome for f, c in columns.items() if (outcome := outcomes.find(c, robot)) is not None}
    parts = _side_by_side(outcomes, {LOOKS[f].label: o for f, o in found.items()}, seconds)
    lacking = [LOOKS[family].label for family in columns if family not in found]
    if lacking:
        parts.append(html.missing(f"missing, not finished: {', '.join(lacking)}."))
    return Shown(f"films: {robot}, {algorithm.upper()}, one per family", parts, kind=KIND)


def films_of(
    outcomes: Outcomes, chosen: Mapping[str, Outcome], seconds: float = 4.0, *, loop: bool = False
) -> Shown:
    """Return films of chosen cells' final policies, as `films` shows those of one robot.

    Args:
        outcomes: where the cells were found.
        chosen: caption → cell; each must keep its policies.
        seconds: of each film.
        loop: in the book, let them play by themselves, over and over.
    """
    return Shown(f"films: {', '.join(chosen)}", _side_by_side(outcomes, chosen, seconds, loop), kind=KIND)


def _side_by_side(
    outcomes: Outcomes, chosen: Mapping[str, Outcome], seconds: float, loop: bool = False
) -> list[str]:
    shown = {_caption(name, o): _film(outcomes, o, seconds) for name, o in chosen.items()}
    return [show_films(shown, loop=loop)._repr_html_()] if shown else []


def middle_seed(outcome: Outcome) -> int:
    """Return the place of the seed whose policy, of those that are kept, has the middle return by the median."""
    returns = outcome.ways["median"][: len(outcome.cell.kept_seeds)]  # which are the first
    return int(np.argsort(returns, kind="stable")[(np.isfinite(returns).sum() - 1) // 2])


def _caption(name: str, outcome: Outcome) -> str:
    seed = middle_seed(outcome)
    return f"{name}, seed {outcome.cell.seeds[seed]}: {outcome.ways['median'][seed]:.0f} points"


def _film(outcomes: Outcomes, outcome: Outcome, seconds: float) -> Film:
    policy = load_policy(outcomes.folder.policy_files(outcome.cell)[0], middle_seed(outcome))
    with closing(gymnasium.make(policy.config.env)) as env:
        return record(env, lambda obs: policy.act(obs, greedy="median"), seconds=seconds, seed=0)
