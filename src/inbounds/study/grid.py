"""What is run: cells of algorithm × family × variant × robot, in the order of `results/PROTOCOL.md`.

    >>> len(study_cells()), [cell.id for cell in select(["standard-swimmer-*"])][:2]
    (136, ['standard-swimmer-ppo-gaussian', 'standard-swimmer-ppo-beta'])

A cell names a run; `Cell.config` spells it out: a preset, changed by the cell's variant.
"""

from __future__ import annotations

import dataclasses
import fnmatch
import hashlib
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Literal, TypeAlias

from inbounds.learning import TrainConfig, preset
from inbounds.learning.storage.stored_config import describe

STUDY_VERSION = 1
"""Raised by whatever changes results: another protocol, another engine. Results of two versions are never mixed."""

ROBOTS = ("HalfCheetah", "Hopper", "Swimmer", "Walker2d", "Ant", "Humanoid")
"""In the order in which an arm runs them."""
ENTROPY_COEFS = (0.0, 1e-3, 1e-2)
MATCHED_NOISE = 0.4  # executed standard deviation before training, of half the action range
LOUD_NOISE = 0.7  # the same; about the Gaussian's default, and within a logit-normal's limits
LONG_GAMMA = 0.9999

PresetName: TypeAlias = Literal["common", "as-printed"]
Variant: TypeAlias = Callable[[TrainConfig], TrainConfig]


def _algorithm(**numbers: Any) -> Variant:
    """Change numbers of the algorithm."""
    return lambda config: dataclasses.replace(
        config, algorithm=dataclasses.replace(config.algorithm, **numbers)
    )


def _whole(**values: Any) -> Variant:
    """Change the run around the algorithm."""
    return lambda config: dataclasses.replace(config, **values)


def _initial_noise(std: float) -> Variant:
    """Set the executed standard deviation before training."""
    return lambda config: dataclasses.replace(
        config, policy=dataclasses.replace(config.policy, initial_std=std)
    )


def _printed_weights(config: TrainConfig) -> TrainConfig:
    network = dataclasses.replace(config.network, initialization="pytorch")
    return dataclasses.replace(config, network=network)


VARIANTS: Mapping[str, Variant] = MappingProxyType(
    {
        "": lambda config: config,
        "matched-noise": _initial_noise(MATCHED_NOISE),
        "loud-noise": _initial_noise(LOUD_NOISE),
        "raw-cost": _whole(action_mode="raw"),
        **{f"entropy-{coef:g}": _algorithm(entropy_coef=coef) for coef in ENTROPY_COEFS},
        f"gamma-{LONG_GAMMA}": _algorithm(gamma=LONG_GAMMA),
        "printed-clip": _algorithm(clip_range=0.02),
        "printed-observations": _whole(normalize_obs=False),
        "printed-advantages": _algorithm(normalize_advantage=False),
        "printed-gradients": _algorithm(max_grad_norm=None),
        "printed-weights": _printed_weights,
    }
)
"""Name → what it changes in the preset; the empty name changes nothing."""


@dataclass(frozen=True)
class Cell:
    """One run of the study: ten seeds of an algorithm, a family, a variant and a robot.

    Example:
        >>> cell = Cell("mechanisms", "ppo", "beta", "Hopper", variant="entropy-0.01")
        >>> cell.id, cell.config.algorithm.entropy_coef, len(cell.digest)
        ('mechanisms-hopper-ppo-beta-entropy-0.01', 0.01, 64)
    """

    arm: str
    """standard, printed, beyond or mechanisms; tests and readers may use names of their own."""
    algorithm: str
    """ppo or trpo."""
    family: str
    """The policy family."""
    robot: str
    """A robot of `ROBOTS`."""
    variant: str = ""
    """A key of `VARIANTS`."""
    preset: PresetName = "common"
    """Where the configuration starts from."""
    keeps_policies: bool = False
    """Whether its final policies, and their returns under each greedy action, are part of the results."""
    seeds: tuple[int, ...] = tuple(range(10))
    """Trained in lockstep."""
    epochs: int = 500
    """Rollouts, each followed by one update."""
    overrides: tuple[tuple[str, Any], ...] = ()
    """Numbers of the algorithm set last, for short runs: (("horizon", 256),)."""

    def __post_init__(self) -> None:
        if self.variant not in VARIANTS:
            raise ValueError(
                f"no variant {self.variant!r}; choose one of {', '.join(filter(None, VARIANTS))}"
            )
        if self.robot not in ROBOTS:
            raise ValueError(f"no robot {self.robot!r}; choose one of {', '.join(ROBOTS)}")

    @property
    def id(self) -> str:
        """Names the cell and its files: unique in the study, sorted by arm and robot."""
        parts = (self.arm, self.robot.lower(), self.algorithm, self.family, self.variant)
        return "-".join(part for part in parts if part)

    @property
    def config(self) -> TrainConfig:
        """The whole configuration."""
        start = preset(
            self.preset,
            f"{self.robot}-v5",
            policy=self.family,
            algo=self.algorithm,
            seeds=self.seeds,
            epochs=self.epochs,
        )
        return _algorithm(**dict(self.overrides))(VARIANTS[self.variant](start))

    @property
    def digest(self) -> str:
        """SHA-256 of the study's version and of every value that decides the cell's results."""
        return digest_of(self.config)


def digest_of(config: TrainConfig) -> str:
    """Return the SHA-256 of the study's version and a configuration, but for how often it saves.

    The engine `autograd` is not named: it was the only one when the first cells were run.
    """
    values = describe(config) | {"checkpoint_every": None, "study_version": STUDY_VERSION}
    if config.engine == "autograd":
        del values["engine"]
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()


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
    """The fourth arm, one thing changed at a time, still in any order."""
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


def _by_robot(cells: list[Cell]) -> tuple[Cell, ...]:
    """All columns of one robot before the next; sorting is stable."""
    return tuple(sorted(cells, key=lambda cell: ROBOTS.index(cell.robot)))


ARMS: Mapping[str, tuple[Cell, ...]] = MappingProxyType(
    {
        "standard": _by_robot(_columns("standard", THESIS, keeps_policies=True)),
        "printed": _by_robot(_columns("printed", THESIS, preset="as-printed")),
        "beyond": _by_robot(_columns("beyond", BEYOND, keeps_policies=True)),
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


def study_cells() -> tuple[Cell, ...]:
    """Return all cells of the protocol, in the order in which they run.

    Example:
        >>> len(study_cells())
        136
    """
    return tuple(cell for cells in ARMS.values() for cell in cells)


def all_cells() -> tuple[Cell, ...]:
    """Return the protocol's cells and those that were asked for afterwards.

    Example:
        >>> len(all_cells()) - len(study_cells())
        7
    """
    return (*study_cells(), *AFTERWARDS)


def select(patterns: Sequence[str] = (), cells: Sequence[Cell] | None = None) -> tuple[Cell, ...]:
    """Return the cells whose id matches one of some patterns, in the study's order.

    Args:
        patterns: ids, arms, or patterns with * and ?; none of them selects all of the protocol.
        cells: to choose from; None is the protocol's and those of `AFTERWARDS`.

    Raises:
        ValueError: a pattern matches nothing.

    Example:
        >>> [cell.id for cell in select(["*-ant-*-raw-cost"])], len(select(["beyond"]))
        (['mechanisms-ant-ppo-gaussian-raw-cost'], 18)
    """
    if cells is None:
        cells = all_cells() if patterns else study_cells()
    matches = {p: [c for c in cells if c.arm == p or fnmatch.fnmatchcase(c.id, p)] for p in patterns}
    if missed := [pattern for pattern, found in matches.items() if not found]:
        raise ValueError(
            f"no cell matches {', '.join(missed)}: use an arm ({', '.join(dict.fromkeys(c.arm for c in cells))}), "
            f"a cell's id like {cells[0].id}, or a pattern like '*-hopper-ppo-*'"
        )
    chosen = {cell.id for found in matches.values() for cell in found}
    return tuple(cell for cell in cells if not patterns or cell.id in chosen)
