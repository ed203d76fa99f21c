"""A cell: one run of a study, as algorithm × family × variant × robot.

    >>> Cell("equal", "ppo", "gaussian", "Hopper", variant="free-std", base=("matched-noise",)).id
    'equal-hopper-ppo-gaussian-free-std'

A cell names a run; `Cell.config` spells it out: a preset, changed by what the cell's arm has in common and by the
cell's own variant. Which cells there are stands in `inbounds.study.grid`.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Literal, TypeAlias

from inbounds.learning import TrainConfig, preset
from inbounds.learning.storage.stored_config import describe

STUDY_VERSION = 1
"""Of the first study. Raised by whatever changes results: another protocol, another engine. Results of two versions are
never mixed."""
SECOND_VERSION = 2
"""Of the second study, which has a protocol, an engine and seeds of its own."""
ROUNDED_ALIKE_VERSION = 3
"""Of the second study's columns that a fault of the code concerned, mended before but one of their cells was run
(`results/HISTORY.md`)."""

ROBOTS = ("HalfCheetah", "Hopper", "Swimmer", "Walker2d", "Ant", "Humanoid")
"""In the order in which an arm runs them."""
ENTROPY_COEFS = (0.0, 1e-3, 1e-2)
MATCHED_NOISE = 0.4  # executed standard deviation before training, of half the action range
LOUD_NOISE = 0.7  # the same; about the Gaussian's default, and within a logit-normal's limits
NOISES = (0.2, 0.55)  # the same; no Beta with α, β ≥ 1 can be louder than 0.577, which is uniform
LEARNING_RATES = (1e-4, 1e-3)  # below and above the preset's 3e-4
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


def _free_std(config: TrainConfig) -> TrainConfig:
    """Make log σ one free number per action dimension."""
    return dataclasses.replace(config, policy=dataclasses.replace(config.policy, state_dependent_std=False))


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
        "free-std": _free_std,
        **{f"noise-{std:g}": _initial_noise(std) for std in NOISES},
        **{f"rate-{rate:g}": _algorithm(learning_rate=rate) for rate in LEARNING_RATES},
    }
)
"""Name → what it changes in the preset; the empty name changes nothing."""


@dataclass(frozen=True)
class Cell:
    """One run of a study: ten seeds of an algorithm, a family, a variant and a robot.

    Example:
        >>> cell = Cell("mechanisms", "ppo", "beta", "Hopper", variant="entropy-0.01")
        >>> cell.id, cell.config.algorithm.entropy_coef, len(cell.digest)
        ('mechanisms-hopper-ppo-beta-entropy-0.01', 0.01, 64)
    """

    arm: str
    """standard, printed, beyond, mechanisms, or one of the second study's; tests and readers may use their own."""
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
    keeps_seeds: tuple[int, ...] | None = None
    """Whose policies are kept; None keeps those of all seeds. Returns are kept of all."""
    seeds: tuple[int, ...] = tuple(range(10))
    """Trained in lockstep."""
    epochs: int = 500
    """Rollouts, each followed by one update."""
    overrides: tuple[tuple[str, Any], ...] = ()
    """Numbers of the algorithm set last, for short runs: (("horizon", 256),)."""
    base: tuple[str, ...] = ()
    """Keys of `VARIANTS` that the whole arm has in common; they come first, and are not in the id."""
    engine: Literal["autograd", "compiled"] = "autograd"
    """What computes the updates."""
    version: int = STUDY_VERSION
    """Of the study that the cell belongs to."""

    def __post_init__(self) -> None:
        for name in (self.variant, *self.base):
            if name not in VARIANTS:
                raise ValueError(f"no variant {name!r}; choose one of {', '.join(filter(None, VARIANTS))}")
        if self.robot not in ROBOTS:
            raise ValueError(f"no robot {self.robot!r}; choose one of {', '.join(ROBOTS)}")

    @property
    def id(self) -> str:
        """Names the cell and its files: unique in the study, sorted by arm and robot."""
        return cell_id(self.arm, self.algorithm, self.family, self.robot, self.variant)

    @property
    def kept_seeds(self) -> tuple[int, ...]:
        """The seeds whose policies are kept, in the order of their files.

        Example:
            >>> Cell("equal", "ppo", "beta", "Humanoid", keeps_policies=True, keeps_seeds=(0, 2)).kept_seeds
            (0, 2)
        """
        return self.seeds if self.keeps_seeds is None else self.keeps_seeds

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
        for name in (*self.base, self.variant):
            start = VARIANTS[name](start)
        start = dataclasses.replace(start, engine=self.engine)
        return _algorithm(**dict(self.overrides))(start)

    @property
    def kept_config(self) -> TrainConfig:
        """The configuration of a run of the seeds whose policies are kept."""
        return dataclasses.replace(self.config, seeds=self.kept_seeds)

    @property
    def digest(self) -> str:
        """SHA-256 of the study's version and of every value that decides the cell's results."""
        return digest_of(self.config, self.version)


def cell_id(arm: str, algorithm: str, family: str, robot: str, variant: str = "") -> str:
    """Return the name of a cell and of its files.

    Example:
        >>> cell_id("standard", "ppo", "beta", "Hopper")
        'standard-hopper-ppo-beta'
    """
    return "-".join(part for part in (arm, robot.lower(), algorithm, family, variant) if part)


def digest_of(config: TrainConfig, version: int = STUDY_VERSION) -> str:
    """Return the SHA-256 of a study's version and a configuration, but for how often it saves.

    The engine `autograd` is not named: it was the only one when the first cells were run.
    """
    values = describe(config) | {"checkpoint_every": None, "study_version": version}
    if config.engine == "autograd":
        del values["engine"]
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()
