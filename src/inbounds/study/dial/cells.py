"""What the map is made of: policies, settings of the knobs, and the run of each, as `results/DIAL.md` fixes them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from inbounds.learning import NetworkConfig, PolicyConfig, PPOConfig, TrainConfig
from inbounds.study.dial.task import DialTask

FRACTIONS = (0.25, 0.5, 0.9, 1.5, 3.0)
DIMS = (1, 8)
SEEDS = tuple(range(10))
EPOCHS = 40
INITIAL_STD = 0.4  # executed, of half the range: the same start for every law
HORIZON = 256

POLICIES: Mapping[str, tuple[str, bool]] = MappingProxyType(
    {
        "gaussian-free": ("gaussian", False),
        "gaussian": ("gaussian", True),
        "beta": ("beta", True),
        "logit-normal": ("logit-normal", True),
    }
)
"""Name → family, and whether σ depends on the state."""
COSTS: Mapping[str, tuple[float, str]] = MappingProxyType(
    {"none": (0.0, "executed"), "raw": (1.0, "raw"), "executed": (1.0, "executed")}
)
"""Setting of the second knob → c, and which action pays it."""


@dataclass(frozen=True)
class DialCell:
    """One run of the map: ten seeds of a policy under one setting of the knobs.

    Example:
        >>> cell = DialCell("beta", 0.5, "raw", 8)
        >>> cell.id, cell.config.action_mode, cell.config.policy.initial_std
        ('f0.5-raw-8-beta', 'raw', 0.4)
    """

    policy: str
    """A key of `POLICIES`."""
    fraction: float
    """Where the best action would lie without a box, in half-ranges."""
    cost: str = "none"
    """A key of `COSTS`."""
    dims: int = 1
    """Dimensions of the action."""
    seeds: tuple[int, ...] = SEEDS
    """Trained in lockstep."""
    epochs: int = EPOCHS
    """Rollouts, each followed by one update."""

    @property
    def id(self) -> str:
        """Names the cell."""
        return f"f{self.fraction:g}-{self.cost}-{self.dims}-{self.policy}"

    @property
    def task(self) -> DialTask:
        """The knobs as they are set."""
        cost, charged = COSTS[self.cost]
        return DialTask(self.fraction, cost, self.dims, "raw" if charged == "raw" else "executed")

    @property
    def config(self) -> TrainConfig:
        """The whole configuration: `common` but for a shorter rollout, a smaller network, and signs as they are."""
        family, state_dependent = POLICIES[self.policy]
        return TrainConfig(
            env="dial",
            seeds=self.seeds,
            epochs=self.epochs,
            algorithm=PPOConfig(horizon=HORIZON),
            policy=PolicyConfig(family, state_dependent_std=state_dependent, initial_std=INITIAL_STD),
            network=NetworkConfig(hidden_sizes=(32, 32)),
            normalize_obs=False,
            engine="autograd",
            action_mode="raw" if self.task.charged == "raw" else "clip",
        )


def dial_cells() -> tuple[DialCell, ...]:
    """Return the map's cells in the order in which they run.

    The cost on the executed action is run in one dimension alone: it should change nothing, which is a check.

    Example:
        >>> len(dial_cells()), len({cell.id for cell in dial_cells()})
        (100, 100)
    """
    settings = [(cost, dims) for cost in ("none", "raw") for dims in DIMS] + [("executed", 1)]
    return tuple(
        DialCell(policy, fraction, cost, dims)
        for cost, dims in settings
        for fraction in FRACTIONS
        for policy in POLICIES
    )
