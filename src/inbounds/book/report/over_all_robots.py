"""An arm over all robots: IQM of normalised scores, probability of improvement, performance profiles."""

from __future__ import annotations

import functools
from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from inbounds.book.drawing.figures import LOOKS
from inbounds.book.report import html
from inbounds.book.report.arms import columns_of
from inbounds.book.report.html import Shown
from inbounds.book.report.study_figures import (
    interval_note,
    interval_panels,
    performance_profiles,
    profile_note,
)
from inbounds.book.report.words import ALGORITHMS, ARM_NAMES, HEADS, in_words, pair_name
from inbounds.study import analysis
from inbounds.study.analysis import CONTRASTS, ENDPOINTS, REFERENCE
from inbounds.study.grid import ROBOTS
from inbounds.study.outcomes import Column, Outcomes
from inbounds.study.statistics import Estimate
from inbounds.study.words import percent, spoken

NORMALIZED = "0: return of the first epoch, 1: final return, of PPO's Gaussian from its usual start"


def over_all_robots(outcomes: Outcomes, arm: str) -> Shown:
    """Return IQM, probability of improvement and profiles of an arm; short where incomplete."""
    title = ARM_NAMES[arm]
    columns = {algorithm: columns_of(arm, algorithm) for algorithm in ALGORITHMS}
    own = [column for row in columns.values() for column in row.values() if column.arm == arm]
    if not any(analysis.normalized(outcomes, column, "final") for column in own):
        lacking = [r for r in ROBOTS if any(outcomes.find(c, r) is None for c in (REFERENCE, *own))]
        said = f"missing ({title}): aggregates need all six robots; not complete yet: {', '.join(lacking)}."
        return html.of_study(f"over all robots, {title}", html.missing(said))
    parts = []
    references = analysis.references(outcomes)
    if flat := [robot for robot, (zero, one) in references.items() if one <= zero]:
        parts.append(html.paragraph(f"Left out, their references not being in order: {', '.join(flat)}."))
    for endpoint, name in ENDPOINTS.items():
        found = {
            a.upper(): {f: analysis.aggregate(outcomes, c, endpoint) for f, c in columns[a].items()}
            for a in ALGORITHMS
        }
        alt = f"IQM of the normalised {name} over all robots ({title}). {in_words(found)}"
        draw = functools.partial(_iqm, found, f"normalised {name}")
        caption = (
            f"{name.capitalize()} ({title}): IQM of all runs, normalised per robot ({NORMALIZED}). "
            f"{interval_note(found)}"
        )
        parts.append(html.figure_of(draw, alt, caption))
    parts += [_improvement(outcomes, arm, title), *_without_diverged(outcomes, arm, title, columns)]
    parts += [_profiles(outcomes, f"{a.upper()}, {title}", columns[a]) for a in ALGORITHMS]
    return html.of_study(f"over all robots, {title}", *parts)


def _iqm(found: Mapping[str, Mapping[str, Estimate | None]], xlabel: str, narrow: bool) -> Figure:
    return interval_panels(found, xlabel=xlabel, narrow=narrow, noted=False)


def _improvement(outcomes: Outcomes, arm: str, title: str, *, without_diverged: bool = False) -> str:
    rows = []
    for contrast in [c for c in CONTRASTS if c.arm == arm]:
        found = [
            analysis.improvement(outcomes, contrast, e, without_diverged=without_diverged) for e in ENDPOINTS
        ]
        rows.append([contrast.algorithm.upper(), pair_name(contrast), *(spoken(e, 2) for e in found)])
    which = ", without seeds that diverged" if without_diverged else ""
    caption = (
        f"Probability of improvement ({title}{which}): that a random run of the first does better than one of the "
        "second, mean over robots."
    )
    return html.table(caption, ["algorithm", "first − second", *HEADS.values()], rows, words=(0, 1))


def _without_diverged(
    outcomes: Outcomes, arm: str, title: str, columns: Mapping[str, Mapping[str, Column]]
) -> list[str]:
    cells = [outcomes.find(c, r) for row in columns.values() for c in row.values() for r in ROBOTS]
    if not any(cell.diverged.any() for cell in cells if cell):
        return []
    rows = [
        [algorithm.upper(), LOOKS[family].label]
        + [spoken(analysis.aggregate(outcomes, column, e, without_diverged=True), 2) for e in ENDPOINTS]
        for algorithm, row in columns.items()
        for family, column in row.items()
    ]
    caption = f"IQM of normalised scores ({title}), without seeds that diverged."
    iqm = html.table(caption, ["algorithm", "family", *HEADS.values()], rows, words=(0, 1))
    return [iqm, _improvement(outcomes, arm, title, without_diverged=True)]


def _profiles(outcomes: Outcomes, title: str, columns: Mapping[str, Column]) -> str:
    scores = {f: analysis.normalized(outcomes, column, "final") for f, column in columns.items()}
    runs = np.array([x for found in scores.values() if found for each in found.values() for x in each])
    low, high = (min(0.0, float(np.nanmin(runs))), float(np.nanmax(runs))) if len(runs) else (0.0, 1.0)
    taus = np.linspace(low, high, 151)
    profiles = {f: analysis.profile(outcomes, c, "final", taus) for f, c in columns.items()}
    above = ", ".join(
        f"{LOOKS[f].label} {percent(np.mean([np.mean(each > 1) for each in found.values()]))}"
        for f, found in scores.items()
        if found
    )
    alt = (
        f"Performance profiles ({title}): the share of runs above each normalised final return, a line "
        f"per family. Above 1: {above or 'missing'}"
    )

    def draw(narrow: bool) -> Figure:
        return performance_profiles(profiles, xlabel="normalised final return τ", narrow=narrow, noted=False)

    caption = f"Performance profiles ({title}): the share of runs above each normalised final return τ ({NORMALIZED})."
    return html.figure_of(draw, alt, f"{caption} {profile_note(profiles)}")
