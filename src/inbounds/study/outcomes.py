"""The finished cells of a study, as arrays with the seeds in front.

    >>> from pathlib import Path
    >>> Outcomes.read(StudyFolder(Path("no/results"))).finished
    {}

Only whole cells are read: one that is not finished, damaged, or of another configuration is named, not used.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from inbounds.learning.storage.whole_files import damaged
from inbounds.study import store
from inbounds.study.cell import cell_id
from inbounds.study.grid import ARMS, Cell, study_cells
from inbounds.study.running import file_checks
from inbounds.study.statistics import carry_forward
from inbounds.study.store import State, StudyFolder

Floats = NDArray[np.float64]


class Column(NamedTuple):
    """What is the same on every robot: a column of the protocol's tables.

    Example:
        >>> Column("mechanisms", "ppo", "beta", "entropy-0").baseline
        Column(arm='standard', algorithm='ppo', family='beta', variant='')
    """

    arm: str
    algorithm: str
    family: str
    variant: str = ""

    @classmethod
    def within(cls, arm: str, algorithm: str, family: str) -> Column:
        """Return an arm's column, or that of the first arm where the arm lacks it and is compared with that one."""
        own = any((cell.algorithm, cell.family) == (algorithm, family) for cell in ARMS[arm])
        return cls(arm if own else "standard", algorithm, family)

    def cell_id(self, robot: str) -> str:
        """Return the id of the column's cell on a robot.

        Example:
            >>> Column("standard", "ppo", "beta").cell_id("Hopper")
            'standard-hopper-ppo-beta'
        """
        return cell_id(self.arm, self.algorithm, self.family, robot, self.variant)

    @property
    def baseline(self) -> Column:
        """What a column of the fourth arm is compared with: nothing changed in it."""
        first = any((c.algorithm, c.family) == (self.algorithm, self.family) for c in ARMS["standard"])
        return Column("standard" if first else "beyond", self.algorithm, self.family)


class Pace(NamedTuple):
    """How long episodes last and what a step earns, in blocks of epochs.

    Made by `Outcome.pace`, which has an example.
    """

    steps: Floats
    """`[S, B]` env steps per episode that ended; infinite where none did."""
    reward: Floats
    """`[S, B]` reward per env step, undiscounted."""


@dataclass(frozen=True)
class Outcome:
    """What a finished cell left.

    Example:
        >>> from inbounds.study.outcomes import Outcomes
        >>> from inbounds.study.store import StudyFolder
        >>> outcome = Outcomes.read(StudyFolder()).finished["standard-hopper-ppo-beta"]  # in the project's folder
        >>> outcome.returns.shape, outcome.cell.robot
        ((10, 500), 'Hopper')
    """

    cell: Cell
    """Which."""
    steps: Floats
    """`[E]` env steps of each seed at the end of each epoch."""
    returns: Floats
    """`[S, E]` mean training return; epochs without one filled by the protocol's rule (`carry_forward`)."""
    greedy: Floats
    """`[S, K]` greedy return of each evaluation, filled likewise."""
    diverged: NDArray[np.bool_]
    """`[S]` whether the seed's weights ceased to be finite."""
    measured: Mapping[str, Floats]
    """`[S, K]` by the names of `inbounds.study.store.MEASURED`, as measured."""
    metadata: Mapping[str, Any]
    """What the cell's file says of itself."""
    ways: Mapping[str, Floats]
    """`[S]` mean return of the final policies by way to act (mean, median, mode, sample), where they were kept."""
    episodes: Floats
    """`[S, E]` episodes that ended within each epoch."""
    lengths: Mapping[str, Floats]
    """`[S]` mean length of the final policies' episodes by way to act [env steps], where they were kept."""

    @classmethod
    def of(
        cls, cell: Cell, table: pa.Table, metadata: Mapping[str, Any], returns: pa.Table | None = None
    ) -> Outcome:
        """Take a cell's rows apart.

        Args:
            cell: whose they are.
            table: as `inbounds.study.read_cell` reads it.
            metadata: as `inbounds.study.store.read_metadata` reads it.
            returns: of the final policies, where they were kept.
        """
        seeds = len(cell.seeds)

        def by_seed(name: str) -> NDArray[Any]:
            values = table[name].to_numpy(zero_copy_only=False)
            return np.ascontiguousarray(values.reshape(-1, seeds).T)  # rows go epoch by epoch, seed by seed

        at = table["greedy_return"].is_valid().to_numpy(zero_copy_only=False)[::seeds]  # [E]
        measured = {name: by_seed(name)[:, at] for name in table.column_names if name in store.MEASURED}
        return cls(
            cell=cell,
            steps=by_seed("env_steps")[0].astype(np.float64),
            returns=carry_forward(by_seed("return_mean")),
            greedy=carry_forward(measured["greedy_return"]),
            diverged=np.asarray(by_seed("diverged").any(1), np.bool_),
            measured=measured,
            metadata=metadata,
            ways={} if returns is None else _by_way(returns, "return", seeds),
            episodes=by_seed("episodes").astype(np.float64),
            lengths={} if returns is None else _by_way(returns, "length", seeds),
        )

    def pace(self, block: int) -> Pace:
        """Take the return of training apart, block by block of epochs.

        Episodes are counted where they end: what the one that is under way has earned counts in the next block.

        Args:
            block: epochs in a block; the number of epochs is a multiple of it.

        Raises:
            ValueError: it is not.

        Example:
            >>> from inbounds.study.outcomes import Outcomes
            >>> from inbounds.study.store import StudyFolder
            >>> outcome = Outcomes.read(StudyFolder()).finished["standard-hopper-ppo-beta"]  # in the project's folder
            >>> pace = outcome.pace(50)
            >>> pace.steps.shape, bool((pace.steps[:, -1] > pace.steps[:, 0]).all())  # it learns to stay up
            ((10, 10), True)
        """
        seeds, epochs = self.episodes.shape
        if block < 1 or epochs % block:
            raise ValueError(
                f"blocks of {block} epochs do not make up {epochs}; choose a divisor of {epochs}"
            )
        earned = self.episodes * np.where(self.episodes > 0, self.returns, 0.0)  # [S, E]
        steps = np.diff(self.steps, prepend=0.0).reshape(-1, block).sum(-1)  # [B], of each seed
        ended, total = (each.reshape(seeds, -1, block).sum(-1) for each in (self.episodes, earned))  # [S, B]
        with np.errstate(divide="ignore"):
            return Pace(steps=steps / ended, reward=total / steps)


def _by_way(episodes: pa.Table, column: str, seeds: int) -> dict[str, Floats]:
    """Return means `[S]` of a column by way to act; rows go way by way, seed by seed, episode by episode."""
    names = episodes["greedy"].to_pylist()
    values = episodes[column].to_numpy()
    return {
        way: values[[name == way for name in names]].reshape(seeds, -1).mean(1)
        for way in dict.fromkeys(names)
    }


def _whole(path: Path, look: Callable[[Cell, pa.Table], str], cell: Cell) -> pa.Table:
    table = store.read_cell(path)
    if said := look(cell, table):
        raise damaged(path, said, store.restore(path))
    return table


@dataclass(frozen=True)
class Outcomes:
    """The finished cells of a study, and the state of every cell.

    Example:
        >>> from inbounds.study.store import StudyFolder
        >>> outcomes = Outcomes.read(StudyFolder())  # in the project's folder
        >>> outcomes.states["standard-hopper-ppo-beta"]
        'finished'
    """

    finished: Mapping[str, Outcome]
    """By the cell's id."""
    states: Mapping[str, State]
    """Of every cell, by its id."""
    folder: StudyFolder
    """Where it was found."""

    @classmethod
    def read(cls, folder: StudyFolder, cells: Sequence[Cell] | None = None) -> Outcomes:
        """Read all finished cells.

        Args:
            folder: where the results are.
            cells: of the study; None is all of it.

        Raises:
            DamagedFileError: a file has its checksum and yet lacks columns or rows.
        """
        cells = study_cells() if cells is None else cells
        states = {cell.id: folder.state(cell) for cell in cells}
        finished = {}
        for cell in cells:
            if states[cell.id] == "finished":
                path, returns_path = folder.cell_file(cell), folder.policy_files(cell)[1]
                table = _whole(path, file_checks.wrong_rows, cell)
                returns = (
                    _whole(returns_path, file_checks.wrong_returns, cell) if cell.keeps_policies else None
                )
                finished[cell.id] = Outcome.of(cell, table, store.read_metadata(path), returns)
        return cls(finished, states, folder)

    def and_of(self, cells: Sequence[Cell]) -> Outcomes:
        """Return the outcomes of these and of more cells, read from the same folder.

        Args:
            cells: the others, finished or not.

        Example:
            >>> from pathlib import Path
            >>> from inbounds.study.grid import AFTERWARDS
            >>> from inbounds.study.store import StudyFolder
            >>> outcomes = Outcomes.read(StudyFolder(Path("no/results")))
            >>> len(outcomes.and_of(AFTERWARDS).states) - len(outcomes.states) == len(AFTERWARDS)
            True
        """
        more = Outcomes.read(self.folder, cells)
        return Outcomes(
            MappingProxyType({**self.finished, **more.finished}),
            MappingProxyType({**self.states, **more.states}),
            self.folder,
        )

    def of_column(self, column: Column, robots: Iterable[str]) -> list[Outcome]:
        """Return a column's finished cells on some robots; `find`, for one robot, has an example."""
        return [outcome for robot in robots if (outcome := self.find(column, robot)) is not None]

    def find(self, column: Column, robot: str) -> Outcome | None:
        """Return a column's cell on a robot, None where it is not finished.

        Example:
            >>> from inbounds.study.outcomes import Column
            >>> from inbounds.study.store import StudyFolder
            >>> outcomes = Outcomes.read(StudyFolder())  # in the project's folder
            >>> outcomes.find(Column("standard", "ppo", "beta"), "Hopper").returns.shape
            (10, 500)
        """
        return self.finished.get(column.cell_id(robot))
