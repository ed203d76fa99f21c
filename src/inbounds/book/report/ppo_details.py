"""What PPO's details change: a detail, its line of code, its measured effects with intervals, from the studies' cells.

::

    from inbounds.book.report.ppo_details import effect_table, effects

    effect_table(effects("../results"))

A detail of which no pair of cells is finished has no row: `not_measured` names it. The table's plain text is the same
whatever is there, so that a stored notebook stays a faithful record while a study goes on.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from inbounds.book import verdicts
from inbounds.book.drawing.figures import LOOKS
from inbounds.book.report.html import Shown
from inbounds.book.templates import macros
from inbounds.learning import FAMILIES
from inbounds.study import StudyFolder, analysis
from inbounds.study.cell import ROBOTS
from inbounds.study.grid import COMPARED, FREE, all_cells
from inbounds.study.outcomes import Column, Outcomes
from inbounds.study.second.primary import pooled_difference
from inbounds.study.statistics import Estimate

__all__ = ["DETAILS", "Detail", "Effect", "effect_table", "effects", "not_measured", "tally_of"]

Pairs = tuple[tuple[Column, Column], ...]


@dataclass(frozen=True)
class Detail:
    """One thing that the formula of the clipped surrogate leaves open.

    Made in `DETAILS`.
    """

    line: str
    """The code that makes the change."""
    variants: tuple[str, ...] = ()
    """Of the first study: its cells are compared with those that differ in nothing else."""
    pairs: Pairs = ()
    """Of the second study: changed and unchanged column."""


def _second(arm: str, variant: str, gaussian: str = "") -> Pairs:
    """Return columns of an arm beside those of the equal start, family by family."""
    return tuple(
        (Column(arm, "ppo", f, variant), Column("equal", "ppo", f, gaussian if f == "gaussian" else ""))
        for f in COMPARED
    )


DETAILS: Mapping[str, Detail] = MappingProxyType(
    {
        "start with executed noise 0.4": Detail(
            "PolicyConfig(initial_std=0.4)",
            ("matched-noise",),
            ((Column("equal", "ppo", "gaussian", FREE), Column("as-they-come", "ppo", "gaussian", FREE)),),
        ),
        "start with executed noise 0.2 instead of 0.4": Detail(
            "PolicyConfig(initial_std=0.2)", pairs=_second("noise", "noise-0.2")
        ),
        "start with executed noise 0.55 instead of 0.4": Detail(
            "PolicyConfig(initial_std=0.55)", pairs=_second("noise", "noise-0.55")
        ),
        "log σ a free parameter": Detail(
            "PolicyConfig(state_dependent_std=False)",
            pairs=tuple(
                (Column("equal", "ppo", f, FREE), Column("equal", "ppo", f))
                for f in ("gaussian", "logit-normal")
            ),
        ),
        "clip range 0.02 instead of 0.2": Detail("ratio.clamp(1 - 0.02, 1 + 0.02)", ("printed-clip",)),
        "no entropy bonus instead of 1e-4": Detail("PPOConfig(entropy_coef=0.0)", ("entropy-0",)),
        "entropy bonus 1e-3": Detail("PPOConfig(entropy_coef=1e-3)", ("entropy-0.001",)),
        "entropy bonus 1e-2": Detail("PPOConfig(entropy_coef=1e-2)", ("entropy-0.01",)),
        "discount 0.9999 instead of 0.99": Detail("PPOConfig(gamma=0.9999)", ("gamma-0.9999",)),
        "control cost of the drawn action": Detail('TrainConfig(action_mode="raw")', ("raw-cost",)),
        "Adam's step size 1e-4 instead of 3e-4": Detail(
            "PPOConfig(learning_rate=1e-4)", pairs=_second("steps", "rate-0.0001", FREE)
        ),
        "Adam's step size 1e-3": Detail(
            "PPOConfig(learning_rate=1e-3)", pairs=_second("steps", "rate-0.001", FREE)
        ),
        "observations as they come": Detail("TrainConfig(normalize_obs=False)", ("printed-observations",)),
        "advantages as they come": Detail("PPOConfig(normalize_advantage=False)", ("printed-advantages",)),
        "gradients not clipped": Detail("PPOConfig(max_grad_norm=None)", ("printed-gradients",)),
        "PyTorch's initial weights": Detail('NetworkConfig(initialization="pytorch")', ("printed-weights",)),
    }
)
"""What is changed, and nothing else → the line that does it, and where it is measured."""


@dataclass(frozen=True)
class Effect:
    """A measured effect: how far the mean final return moves when one detail is changed.

    Made by `effects`, which has an example.
    """

    detail: str
    """A key of `DETAILS`."""
    robot: str
    """Where."""
    policy: str
    """Whose, in words."""
    change: Estimate
    """Changed minus unchanged, with its interval."""


def effects(results: str | Path | Outcomes) -> tuple[Effect, ...]:
    """Return every effect of which both cells are finished, under PPO.

    Args:
        results: the studies' folder of results, or what has been read from it.

    Example:
        >>> effects("no/results")
        ()
    """
    if not isinstance(results, Outcomes):
        cells = [cell for cell in all_cells() if cell.algorithm == "ppo"]
        results = Outcomes.read(StudyFolder(Path(results)), cells)
    return tuple(effect for name in DETAILS for effect in _effects_of(results, name))


def not_measured(found: Sequence[Effect]) -> tuple[str, ...]:
    """Return the details of which nothing is measured.

    Example:
        >>> not_measured(()) == tuple(DETAILS)
        True
    """
    measured = {effect.detail for effect in found}
    return tuple(name for name in DETAILS if name not in measured)


def tally_of(found: Sequence[Effect], detail: str) -> str:
    """Return on which side of zero the effects of a detail lie.

    Args:
        found: by `effects`.
        detail: a key of `DETAILS`.
    """
    return verdicts.tally([effect.change for effect in found if effect.detail == detail])


def effect_table(found: Sequence[Effect]) -> Shown:
    """Return the table: a group of rows for each measured detail, its line of code above it.

    Args:
        found: by `effects`.

    Example:
        >>> effect_table(())
        <table: what a change of one detail does to the final return>
    """
    groups = [
        (
            name,
            detail.line,
            tally_of(found, name),
            [
                (effect.robot, effect.policy, *told(effect.change))
                for effect in found
                if effect.detail == name
            ],
        )
        for name, detail in DETAILS.items()
        if name not in not_measured(found)
    ]
    return Shown(
        "table: what a change of one detail does to the final return", [macros("details").table(groups)]
    )


def told(change: Estimate) -> tuple[str, str]:
    """Say a change with its interval, and on which side of zero it lies.

    Example:
        >>> import numpy as np
        >>> told(Estimate(np.array(-12.4), np.array(-30.6), np.array(5.0), 10, 0, 0.95, "difference"))
        ('−12 [−31, 5]', 'no difference found')
    """
    number, _, word = verdicts.told(change, digits=0).rpartition(", ")
    return f"{number}, {change.diverged} diverged" if change.diverged else number, word


def _effects_of(outcomes: Outcomes, name: str) -> Iterator[Effect]:
    detail = DETAILS[name]
    for variant in detail.variants:
        for arm in ("mechanisms", "afterwards"):
            for family in FAMILIES:
                for robot in ROBOTS:
                    outcome = outcomes.find(Column(arm, "ppo", family, variant), robot)
                    change = analysis.change(outcomes, outcome, "final") if outcome else None
                    if change:
                        yield Effect(name, robot, LOOKS[family].label, change)
    for pair in detail.pairs:
        for robot in ROBOTS:
            change = pooled_difference(outcomes, *pair, robot, "final")
            if change:
                free = " with a free σ" if FREE in (pair[0].variant, pair[1].variant) else ""
                yield Effect(name, robot, LOOKS[pair[0].family].label + free, change)
