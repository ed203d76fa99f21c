"""A training run that measures itself, after the first and after every tenth epoch, without noticing it.

The loop is the one of `inbounds.learning.train`. What is measured is written beside the trainer's own state, so that a
checkpoint holds the measurements of exactly the epochs that it holds.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from torch import Tensor

from inbounds.learning import DivergedSeedWarning, Rollout, Trainer
from inbounds.study import store
from inbounds.study.grid import Cell
from inbounds.study.running.evaluate import GreedyEvaluation
from inbounds.study.ways_played import FIRST_STEPS

MEASURE_EVERY = 10  # epochs; the first is measured too: its rollout is the untrained policy's


class Progress:
    """What a cell has done and what it cost: goes into checkpoints beside the trainer's state."""

    def __init__(self) -> None:
        self.measurements: list[dict[str, Any]] = []
        self.sessions: list[dict[str, Any]] = []
        self.first_rewards: NDArray[Any] = np.zeros((0, 0))
        self.seconds = {"training": 0.0, "evaluation": 0.0, "final evaluation": 0.0, "total": 0.0}

    def state_dict(self) -> dict[str, Any]:
        """Return it, packed."""
        return {**vars(self), "measurements": pack(self.measurements)}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Go back to what `state_dict` returned."""
        vars(self).update({**state, "measurements": unpack(state["measurements"])})


class MeasuredTrainer:
    """A run that measures itself after the first and after every tenth epoch.

    Args:
        cell: whose configuration to run.

    Example:
        >>> small = (("horizon", 64), ("minibatch_size", 32), ("num_epochs", 1))
        >>> cell = Cell("test", "ppo", "beta", "Swimmer", seeds=(0, 1), epochs=10, overrides=small)
        >>> run = MeasuredTrainer(cell)
        >>> for _ in range(10):
        ...     run.epoch()
        >>> [measured["epoch"] for measured in run.progress.measurements]
        [0, 9]
        >>> run.progress.measurements[0]["alpha_q50"].shape
        (2,)
    """

    def __init__(self, cell: Cell) -> None:
        self.config = cell.config
        self.progress = Progress()
        self.trainer = Trainer(self.config)
        self.evaluation = GreedyEvaluation(self.trainer)

    @property
    def done(self) -> int:
        """Epochs done."""
        return len(self.trainer.records)

    def epoch(self) -> None:
        """Do one epoch, and measure after the first and every tenth."""
        with warnings.catch_warnings():
            warnings.simplefilter(
                "ignore", DivergedSeedWarning
            )  # it is in the rows, and what to do is in the protocol
            record = self.trainer.epoch()
        self.progress.seconds["training"] += record["seconds"]
        rollout = self.trainer.rollout
        assert rollout is not None
        if self.done == 1:
            self.progress.first_rewards = rollout.reward[:, :FIRST_STEPS].double().numpy().copy()
        if self.done == 1 or self.done % MEASURE_EVERY == 0:
            self._measure(record, rollout)

    def table(self) -> pa.Table:
        """Return the rows so far."""
        return store.table_of(self.config, self.trainer.records, self.progress.measurements)

    def _measure(self, record: Mapping[str, Any], rollout: Rollout) -> None:
        start = time.perf_counter()
        greedy_return = self.evaluation(record["epoch"])
        seconds = time.perf_counter() - start
        self.progress.seconds["evaluation"] += seconds
        measured = {"epoch": record["epoch"], "greedy_return": greedy_return, "evaluation_seconds": seconds}
        measured |= {name: value for name, value in record.items() if name in store.MEASURED}
        parameters = rollout.parameters.each(Tensor.numpy)  # [S, T, A]
        measured |= self.trainer.networks.policy.law.describe(parameters, self.config.policy.limits)
        self.progress.measurements.append(measured)

    def state_dict(self) -> dict[str, Any]:
        """Return everything that the future, and the results, depend on."""
        state = self.trainer.state_dict()
        return state | {"records": pack(self.trainer.records), "study": self.progress.state_dict()}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Go back to a state from `state_dict` of a run with the same configuration."""
        self.trainer.load_state_dict({**state, "records": unpack(state["records"])})
        self.progress.load_state_dict(state["study"])

    def close(self) -> None:
        """Close the environments."""
        self.evaluation.players.close()
        self.trainer.envs.close()


# ---- packed records: a checkpoint with five hundred small dictionaries would take longer than an epoch


def pack(records: Sequence[Mapping[str, Any]]) -> dict[str, NDArray[Any]]:
    """Return records with the same names as one array `[E, ...]` per name.

    Example:
        >>> pack([{"epoch": 0, "kl": np.zeros(2)}, {"epoch": 1, "kl": np.ones(2)}])["kl"].shape
        (2, 2)
    """
    return {name: np.stack([record[name] for record in records]) for name in (records[0] if records else ())}


def unpack(packed: Mapping[str, NDArray[Any]]) -> list[dict[str, Any]]:
    """Return the records that `pack` was given; numbers as Python numbers."""
    number = len(next(iter(packed.values()))) if packed else 0
    return [
        {name: array[i].item() if array.ndim == 1 else array[i].copy() for name, array in packed.items()}
        for i in range(number)
    ]
