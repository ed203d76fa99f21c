"""What is run: the cells of both studies, in the order of their protocols (`results/PROTOCOL.md`, `PROTOCOL-2.md`).

    >>> len(study_cells()), [cell.id for cell in select(["standard-swimmer-*"])][:2]
    (136, ['standard-swimmer-ppo-gaussian', 'standard-swimmer-ppo-beta'])

What a cell is stands in `inbounds.study.cell`.
"""

from __future__ import annotations

import fnmatch
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import product
from types import MappingProxyType
from typing import Any

from inbounds.study.cell import LEARNING_RATES, NOISES, ROUNDED_ALIKE_VERSION, SECOND_VERSION
from inbounds.study.cell import LONG_GAMMA as LONG_GAMMA
from inbounds.study.cell import ROBOTS as ROBOTS
from inbounds.study.cell import STUDY_VERSION as STUDY_VERSION
from inbounds.study.cell import VARIANTS as VARIANTS
from inbounds.study.cell import Cell as Cell

THESIS = (
    ("ppo", "gaussian"),
    ("ppo", "beta"),
    ("ppo", "logit-normal"),
    ("trpo", "gaussian"),
    ("trpo", "logit-normal"),
)
"""The five columns of the source thesis."""
BEYOND = (("trpo", "beta"), ("ppo", "clipped-gaussian"), ("trpo", "clipped-gaussian"))
LOOKED_INTO = ("matched-noise", f"gamma-{LONG_GAMMA}")
"""Variants of the fourth arm whose final policies are kept: the book looks at how their robots move."""
COMPARED = ("gaussian", "beta", "logit-normal")


def _mechanisms() -> list[Cell]:
    """Return the fourth arm, one thing changed at a time, still in any order."""
    printed = [name for name in VARIANTS if name.startswith("printed-")]
    entropy = [name for name in VARIANTS if name.startswith("entropy-")]
    plan: list[tuple[Sequence[str], Sequence[str], Sequence[str], Sequence[str]]] = [
        # variants, algorithms, families, robots
        (["matched-noise"], ["ppo"], COMPARED, ["HalfCheetah", "Hopper", "Swimmer", "Walker2d"]),
        (["raw-cost"], ["ppo"], ["gaussian"], ["HalfCheetah", "Ant"]),
        (entropy, ["ppo"], COMPARED, ["HalfCheetah", "Hopper"]),
        ([f"gamma-{LONG_GAMMA}"], ["ppo", "trpo"], COMPARED, ["Swimmer"]),
        (printed, ["ppo"], ["gaussian", "logit-normal"], ["HalfCheetah", "Hopper"]),
    ]
    return [
        Cell("mechanisms", algorithm, family, robot, variant, keeps_policies=variant in LOOKED_INTO)
        for variants, algorithms, families, robots in plan
        for variant in variants
        for algorithm in algorithms
        for family in families
        for robot in robots
    ]


def _columns(arm: str, columns: Iterable[tuple[str, str]], **values: Any) -> list[Cell]:
    return [
        Cell(arm, algorithm, family, robot, **values) for algorithm, family in columns for robot in ROBOTS
    ]


def _lean(cell: Cell) -> Cell:
    """Return a cell of arm 3, which keeps its policies if a page looks into them: all of them would be too much."""
    return replace(cell, keeps_policies=cell.robot == "HalfCheetah" or cell.id == "beyond-swimmer-trpo-beta")


def _by_robot(cells: list[Cell]) -> tuple[Cell, ...]:
    """Return all columns of one robot before the next; sorting is stable."""
    return tuple(sorted(cells, key=lambda cell: ROBOTS.index(cell.robot)))


ARMS: Mapping[str, tuple[Cell, ...]] = MappingProxyType(
    {
        "standard": _by_robot(_columns("standard", THESIS, keeps_policies=True)),
        "printed": _by_robot(_columns("printed", THESIS, preset="as-printed")),
        "beyond": _by_robot([_lean(cell) for cell in _columns("beyond", BEYOND, keeps_policies=True)]),
        "mechanisms": _by_robot(_mechanisms()),
    }
)
"""Arm → its cells, both in the order in which they run."""


AFTERWARDS = tuple(
    Cell("afterwards", algorithm, family, robot, variant, keeps_policies=True)
    for algorithm, family, robot, variant in (
        ("trpo", "gaussian", "HalfCheetah", "matched-noise"),
        ("trpo", "logit-normal", "HalfCheetah", "matched-noise"),
        ("ppo", "gaussian", "Ant", "matched-noise"),
        ("trpo", "gaussian", "Ant", "matched-noise"),
        ("ppo", "gaussian", "Humanoid", "matched-noise"),
        ("trpo", "logit-normal", "Ant", "loud-noise"),
        ("trpo", "logit-normal", "HalfCheetah", "loud-noise"),
    )
)
"""Asked for after results had been seen, and outside the protocol: `results/AFTERWARDS.md` says when and why."""


FREE = "free-std"
EQUAL = ("matched-noise",)  # every family starts with the executed noise 0.4
FIRST_SEEDS, MORE_SEEDS = tuple(range(10, 20)), tuple(range(20, 30))
PRIMARY = (("gaussian", FREE), ("beta", ""), ("logit-normal", ""))
"""The columns, family and variant, of the primary comparison."""
LAWS = (*PRIMARY, ("gaussian", ""))


def _second(
    arm: str,
    algorithm: str,
    columns: Iterable[tuple[str, str]],
    robots: Sequence[str] = ROBOTS,
    *,
    policies: int = 0,
    **values: Any,
) -> list[Cell]:
    """Return the cells of columns of the second study; the policies of so many seeds are kept, on Humanoid of three."""
    common: dict[str, Any] = {"seeds": FIRST_SEEDS, "engine": "compiled"} | values
    return [
        Cell(
            arm,
            algorithm,
            family,
            robot,
            variant,
            keeps_policies=policies > 0,
            keeps_seeds=FIRST_SEEDS[: min(policies, 3 if robot == "Humanoid" else policies)] or None,
            version=_version(algorithm, family, free=FREE in (variant, *values.get("base", ()))),
            **common,
        )
        for family, variant in columns
        for robot in robots
    ]


def _version(algorithm: str, family: str, *, free: bool) -> int:
    """Return the version of a column of the second study: a fault of the code concerned one of them."""
    concerned = (algorithm, family) == ("ppo", "logit-normal") and not free
    return ROUNDED_ALIKE_VERSION if concerned else SECOND_VERSION


def _noise_and_steps() -> tuple[list[Cell], list[Cell]]:
    """Return blocks E and F: other noise, other step sizes."""
    noises = [f"noise-{std:g}" for std in NOISES]
    rates = [f"rate-{rate:g}" for rate in LEARNING_RATES]
    noise = _second("noise", "ppo", product(COMPARED, noises), ("HalfCheetah", "Hopper", "Ant"))
    steps = [
        cell
        for family, free in (("gaussian", (FREE,)), ("beta", ()), ("logit-normal", ()))
        for cell in _second("steps", "ppo", product([family], rates), ROBOTS[:2], base=(*EQUAL, *free))
    ]
    return noise, steps


SECOND: Mapping[str, tuple[Cell, ...]] = MappingProxyType(
    {
        "B": _by_robot(
            _second("equal", "ppo", LAWS, policies=10, base=EQUAL)
            + _second("equal", "ppo", [("logit-normal", FREE)], base=EQUAL)
        ),
        "B, more seeds": _by_robot(_second("equal-more", "ppo", PRIMARY, base=EQUAL, seeds=MORE_SEEDS)),
        "C": _by_robot(_second("equal", "trpo", LAWS, policies=5, base=EQUAL)),
        "D": _by_robot(_second("as-they-come", "ppo", [("gaussian", FREE)], policies=5)),
        **{block: _by_robot(cells) for block, cells in zip("EF", _noise_and_steps(), strict=True)},
    }
)
"""The second study's blocks (`results/PROTOCOL-2.md`), in the order in which they run."""


def second_cells() -> tuple[Cell, ...]:
    """Return all cells of the second study, in the order in which they run.

    Example:
        >>> len(second_cells()), {cell.version for cell in second_cells()}
        (108, {2, 3})
    """
    return tuple(cell for cells in SECOND.values() for cell in cells)


def study_cells() -> tuple[Cell, ...]:
    """Return all cells of the protocol, in the order in which they run.

    Example:
        >>> len(study_cells())
        136
    """
    return tuple(cell for cells in ARMS.values() for cell in cells)


def all_cells() -> tuple[Cell, ...]:
    """Return the cells of both protocols and those that were asked for afterwards.

    Example:
        >>> from inbounds.study.grid import second_cells, study_cells
        >>> len(all_cells()) - len(study_cells()) - len(second_cells())
        7
    """
    return (*study_cells(), *AFTERWARDS, *second_cells())


def select(patterns: Sequence[str] = (), cells: Sequence[Cell] | None = None) -> tuple[Cell, ...]:
    """Return the cells whose id matches one of some patterns, in the study's order.

    Args:
        patterns: ids, arms, or patterns with * and ?; none of them selects all of the first protocol.
        cells: to choose from; None is both protocols' and those of `AFTERWARDS`.

    Raises:
        ValueError: a pattern matches nothing.

    Example:
        >>> [cell.id for cell in select(["*-ant-*-raw-cost"])], len(select(["beyond"]))
        (['mechanisms-ant-ppo-gaussian-raw-cost'], 18)
    """
    patterns = (patterns,) if isinstance(patterns, str) else patterns
    if cells is None:
        cells = all_cells() if patterns else study_cells()
    matches = {p: [c for c in cells if c.arm == p or fnmatch.fnmatchcase(c.id, p)] for p in patterns}
    if missed := [pattern for pattern, found in matches.items() if not found]:
        if not cells:
            raise ValueError(f"no cell matches {', '.join(missed)}: there are no cells to choose from")
        raise ValueError(
            f"no cell matches {', '.join(missed)}: use an arm ({', '.join(dict.fromkeys(c.arm for c in cells))}), "
            f"a cell's id like {cells[0].id}, or a pattern like '*-hopper-ppo-*'"
        )
    chosen = {cell.id for found in matches.values() for cell in found}
    return tuple(cell for cell in cells if not patterns or cell.id in chosen)
