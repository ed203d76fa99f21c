"""Play the shipped policies by every way to act, from the starts of their final evaluation.

The policies stand in a run again, as they were when their final evaluation was played, so that mean, median, mode
and sample repeat the returns of `results/policies` bit for bit on the processor of that evaluation (to rounding, where
not all of a cell's policies are kept: a batch of another size rounds otherwise).
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Sequence
from contextlib import closing
from typing import Any

import numpy as np
import pyarrow as pa
import safetensors.numpy
import torch
from numpy.typing import NDArray

from inbounds.learning import Trainer
from inbounds.learning.storage.parquet import parquet_bytes
from inbounds.study import store
from inbounds.study.grid import ROBOTS, STUDY_VERSION, Cell
from inbounds.study.running.evaluate import FINAL, Players, generator_of
from inbounds.study.running.provenance import provenance
from inbounds.study.store import StudyFolder
from inbounds.study.ways_played import (
    EPISODES,
    FIRST_STEPS,
    NOTHING,
    SNAPPED,
    evaluation_file,
    nothing_file,
    nothing_schema,
    other_policies,
    schema,
    summary,
    ways_of,
)

Row = dict[str, Any]


class WatchedPlayers(Players):
    """The policies of a run, who may also act bang-bang or not at all, and whose actions and rewards are noted.

    Args:
        trainer: the run.
        episodes: E, of each seed.

    Example:
        >>> from inbounds.learning import preset
        >>> players = WatchedPlayers(Trainer(preset("common", "Hopper-v5", seeds=2)), episodes=3)
        >>> [row["length"] > 5 for row in players.rows("nothing")]
        [True, True, True, True, True, True]
    """

    def __init__(self, trainer: Trainer, episodes: int) -> None:
        super().__init__(trainer, episodes)
        self._seen: list[NDArray[Any]] = []
        self._rewards: list[NDArray[Any]] = []
        step = self.envs.step

        def noting(actions: NDArray[Any]) -> Any:
            result = step(actions)
            self._rewards.append(np.array(result[1]))
            return result

        self.envs.step = noting  # type: ignore[method-assign]

    def rows(self, way: str) -> list[Row]:
        """Play the episodes of all seeds and return a row for each, by the names of `ways_played.COLUMNS`."""
        self._seen, self._rewards = [], []
        seeds = self.trainer.config.seeds
        starts = [int(s) for seed in seeds for s in final_starts(seed)[: self.episodes]]
        generators = [generator_of(seed, FINAL + 1) for seed in seeds]
        returns, lengths = self.play(way, starts, generators)
        actions, rewards = np.stack(self._seen, 1), np.stack(self._rewards, 1)  # [S·E, T, A], [S·E, T]
        rows: list[Row] = []
        for s, seed in enumerate(seeds):
            for e in range(self.episodes):
                i, length = s * self.episodes + e, int(lengths[s, e])
                first = float(rewards[i, : min(length, FIRST_STEPS)].sum())
                row = {"seed": seed, "way": way, "episode": e, "return": returns[s, e], "length": length}
                rows.append(row | {"first_reward": first} | summary(actions[i], length))
        return rows

    def _act(self, obs: NDArray[Any], way: str, generators: Sequence[np.random.Generator]) -> NDArray[Any]:
        policy = self.trainer.networks.policy
        centre, half_range = policy.centre, policy.half_range
        if way == NOTHING:
            action = np.broadcast_to(centre, (len(obs), policy.act_dim)).astype(policy.dtype)
        else:
            action = super()._act(obs, SNAPPED.get(way, way), generators)
            if way in SNAPPED:
                action = np.where(action < centre, policy.low, policy.high).astype(policy.dtype)
        self._seen.append((action - centre) / half_range)
        return action


def final_starts(seed: int) -> NDArray[Any]:
    """Return the seeds `[10]` of the starts of a seed's final evaluation."""
    return generator_of(seed, FINAL).integers(2**31, size=max(EPISODES.values()))


def run_with_policies(cell: Cell, folder: StudyFolder, *, count: int = 1, **changes: Any) -> Trainer:
    """Return a run of a cell's kept seeds in which the shipped policies stand; its values and its past are not theirs.

    Args:
        cell: which keeps its policies.
        folder: where they are.
        count: observations that their statistics count for: how little new ones move them.
        changes: of the cell's configuration, such as `engine="autograd"`.

    Raises:
        FileNotFoundError: they are not there.
        DamagedFileError: their file is damaged.
    """
    folder.load_policies(cell)  # looks at the checksum
    tensors = safetensors.numpy.load_file(folder.policy_files(cell)[0])
    trainer = Trainer(dataclasses.replace(cell.kept_config, **changes))
    with torch.no_grad():
        for i, layer in enumerate(trainer.networks.actor.layers):
            layer.weight[:] = torch.from_numpy(tensors[f"policy.{i}.weight"])
            layer.bias[:, :, 0] = torch.from_numpy(tensors[f"policy.{i}.bias"])
    if (normalizer := trainer.collector.normalizer) is not None:
        normalizer.count = count
        normalizer.mean[:], normalizer.squares[:] = (
            tensors["normalizer.mean"],
            tensors["normalizer.variance"] * count,
        )
    trainer.diverged[:] = tensors["diverged"]
    return trainer


def play_cell(cell: Cell, folder: StudyFolder, ways: Sequence[str] | None = None) -> list[Row]:
    """Return the rows of a cell's policies, way by way, seed by seed.

    Args:
        cell: which keeps its policies.
        folder: where they are.
        ways: to act; None is all of `ways_played.ways_of`.

    Example:
        >>> from inbounds.study import select
        >>> cell, = select(["standard-hopper-ppo-beta"])
        >>> rows = play_cell(cell, StudyFolder(), ["median-snapped"])  # in the project's folder
        >>> len(rows), rows[0]["at_bounds"]
        (100, 1.0)
    """
    with closing(WatchedPlayers(run_with_policies(cell, folder), EPISODES[cell.robot])) as players:
        return [row for way in (ways_of(cell.family) if ways is None else ways) for row in players.rows(way)]


def evaluate_cells(
    cells: Sequence[Cell], folder: StudyFolder, say: Callable[[str], None] = lambda line: None
) -> list[Cell]:
    """Play the policies of every cell that has shipped them and has not been played, and write what they earn.

    A cell's file is written whole, after its checksum: the same command goes on where it stopped. An evaluation of
    other policies, as of a cell that has been run again since, is replaced.

    Args:
        cells: to choose from.
        folder: of the study.
        say: called with a line for each cell.

    Returns:
        The cells that have been played now.

    Raises:
        DamagedFileError: a file of policies, or of what they earned, is damaged.
    """
    shipped = [
        c for c in cells if c.keeps_policies and all(path.is_file() for path in folder.policy_files(c))
    ]
    if shipped and not nothing_file(folder).is_file():
        _publish_nothing(folder)
        say(f"{NOTHING}: played")
    played = []
    for i, cell in enumerate(shipped):
        path = evaluation_file(folder, cell)
        if path.is_file() and not other_policies(folder, cell):
            continue
        table = pa.Table.from_pylist(play_cell(cell, folder), schema())
        policies = store.sha256(folder.policy_files(cell)[0])
        metadata = store.cell_metadata(cell, cell.config, policies=policies, session=provenance())
        folder.publish({path: parquet_bytes(table, metadata)})
        played.append(cell)
        say(f"{cell.id}: played ({i + 1} of {len(shipped)})")
    return played


def _publish_nothing(folder: StudyFolder) -> None:
    rows: list[Row] = []
    for robot in ROBOTS:
        trainer = Trainer(Cell("standard", "ppo", "gaussian", robot).config)
        with closing(WatchedPlayers(trainer, EPISODES[robot])) as players:
            rows += [{"robot": robot} | row for row in players.rows(NOTHING)]
    kinds = nothing_schema()
    about = {"study_version": STUDY_VERSION, "id": NOTHING, "config": {}, "session": provenance()}
    table = pa.Table.from_pylist([{name: row[name] for name in kinds.names} for row in rows], kinds)
    folder.publish({nothing_file(folder): parquet_bytes(table, json.dumps(about))})
