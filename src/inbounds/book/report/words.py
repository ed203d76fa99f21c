"""What the study's pages call things: arms, endpoints, pairs of families, and a figure's values in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from inbounds.book.drawing.figures import LOOKS
from inbounds.book.report.equal_start import clear
from inbounds.book.report.study_figures import SHORT
from inbounds.study.analysis import Contrast
from inbounds.study.grid import FREE
from inbounds.study.outcomes import Column
from inbounds.study.statistics import Estimate
from inbounds.study.words import number

ALGORITHMS = ("ppo", "trpo")
ARM_NAMES: Mapping[str, str] = {
    "standard": "standard practice",
    "printed": "as printed",
    "beyond": "beyond the thesis",
    "mechanisms": "mechanisms",
}
"""Arm → its name within a sentence, in the protocol's order."""
ARM_TITLES: Mapping[str, str] = {
    arm: f"Arm {place}: {name}" for place, (arm, name) in enumerate(ARM_NAMES.items(), 1)
}
"""Arm → its heading."""
CHANGES: Mapping[str, str] = {
    "matched-noise": "start at noise 0.4",
    "loud-noise": "loud start",
    "raw-cost": "drawn action billed",
    FREE: "free σ",
}
"""Variant → what it changes, where its name does not say it."""
LETTERS: Mapping[str, str] = {"gamma": "γ", "rate": "step size"}
HEADS: Mapping[str, str] = {"final": "final return", "area": "area", "greedy": "greedy return"}
"""Endpoint → title of its column."""


def title_of(arm: str, algorithm: str) -> str:
    """Return the name of an algorithm's part of an arm.

    Example:
        >>> title_of("printed", "ppo")
        'PPO, as printed'
    """
    return f"{algorithm.upper()}, {ARM_NAMES[arm]}"


def pair_name(contrast: Contrast) -> str:
    """Return what is compared, as a difference."""
    return f"{SHORT[contrast.first]} − {SHORT[contrast.second]}"


def column_name(column: Column) -> str:
    """Return what a column is called within its arm.

    Example:
        >>> [column_name(Column(arm, "ppo", "gaussian", "free-std")) for arm in ("equal", "as-they-come")]
        ['Gaussian free σ', 'Gaussian free σ, start at σ = 1']
    """
    free = column.variant == FREE or (column.arm == "steps" and column.family == "gaussian")
    sigma = " free σ" if free else " σ(s)" if column.family == "gaussian" else ""
    changed = "" if column.variant in ("", FREE) else f", {change_name(column.variant)}"
    start = ", start at σ = 1" if column.arm == "as-they-come" else ""
    return f"{SHORT[column.family]}{sigma}{changed}{start}"


def change_name(variant: str) -> str:
    """Return what a cell's variant changes, in words.

    Example:
        >>> [change_name(variant) for variant in ("matched-noise", "gamma-0.9999", "printed-clip", "")]
        ['start at noise 0.4', 'γ 0.9999', 'printed clip', '']
    """
    word, _, value = variant.partition("-")
    return CHANGES.get(variant, f"{LETTERS.get(word, word)} {value}".strip())


def graded(verdict: str, difference: Estimate) -> str:
    """Return a verdict as the pages' grades have it: an interval by itself suggests a side, or near 0 nothing.

    Args:
        verdict: what `inbounds.study.words.verdict` says.
        difference: of what.

    Example:
        >>> import numpy as np
        >>> near, far = (Estimate(np.array(9.0), np.array(e), np.array(20.0), 10, 0, 0.95, "") for e in (0.1, 1.0))
        >>> graded("not after Holm", near), graded("not after Holm", far), graded("higher", near)
        ('unresolved', 'suggested above', 'higher')
    """
    if verdict != "not after Holm":
        return verdict
    if not clear(difference):
        return "unresolved"
    return "suggested above" if difference.value > 0 else "suggested below"


WAITS = "waits for seeds"
"""The verdict on a difference that a protocol tests when more seeds have run."""


def by_robot(verdicts: Sequence[tuple[str, str]]) -> str:
    """Return on which robots a difference is found above 0 or below, suggested or too small, and on how many it is not.

    What holds on no robot is left out.

    Args:
        verdicts: robot, and what `graded` says there, or *too small to matter*, or `WAITS`; other words count as none.

    Example:
        >>> by_robot([("Ant", "higher"), ("Hopper", "suggested below")])
        'above on 1 of 2 robots (Ant), suggested below on 1 (Hopper)'
        >>> by_robot([("Hopper", "lower"), ("Humanoid", WAITS)])
        'below on 1 of 2 robots (Hopper), seeds still to be run on 1 (Humanoid)'
        >>> by_robot([("Ant", ""), ("Hopper", "")])
        'above or below on none of 2 robots'
        >>> by_robot([])
        'not run yet'
    """
    if not verdicts:
        return "not run yet"
    words = [("above", "higher"), ("below", "lower")]
    words += [
        ("seeds still to be run" if word == WAITS else word, word)
        for word in ("suggested above", "suggested below", "too small to matter", WAITS)
    ]
    parts: list[str] = []
    for said, word in (*words, ("no difference found", "unresolved")):
        found = [robot for robot, verdict in verdicts if verdict == word]
        if found:
            size = "" if parts else f" of {robots(len(verdicts))}"
            named = "" if word == "unresolved" else f" ({', '.join(found)})"
            parts.append(f"{said} on {len(found)}{size}{named}")
    return ", ".join(parts) or f"above or below on none of {robots(len(verdicts))}"


def robots(count: int) -> str:
    """Return a number of robots, in words.

    Example:
        >>> robots(1), robots(6)
        ('1 robot', '6 robots')
    """
    return f"{count} robot{'' if count == 1 else 's'}"


def in_words(panels: Mapping[str, Mapping[str, Estimate | None]]) -> str:
    """Return the values of estimates by panel and family, for those who cannot see the figure."""
    return ". ".join(
        f"{panel}: "
        + ", ".join(f"{LOOKS[f].label} {number(e.value) if e else 'missing'}" for f, e in row.items())
        for panel, row in panels.items()
    )
