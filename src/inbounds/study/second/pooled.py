"""The seeds of a column on a robot, from all cells that hold some."""

from __future__ import annotations

from functools import cache

import numpy as np

from inbounds.study.analysis import scores
from inbounds.study.cell import ROBOTS
from inbounds.study.grid import all_cells
from inbounds.study.outcomes import Column, Floats, Outcome, Outcomes

MORE_SEEDS_OF = {"equal": "equal-more"}  # arm → the arm with the same columns and other seeds


def _parts(column: Column) -> list[Column]:
    """Return the columns that hold seeds of one: itself, and that of the arm with further seeds."""
    further = MORE_SEEDS_OF.get(column.arm)
    return [column, column._replace(arm=further)] if further else [column]


def pooled(outcomes: Outcomes, column: Column, robot: str) -> list[Outcome]:
    """Return the finished cells of a column on a robot: one, or two where the arm has further seeds."""
    found = (outcomes.find(part, robot) for part in _parts(column))
    return [outcome for outcome in found if outcome is not None]


def is_whole(outcomes: Outcomes, column: Column, robot: str) -> bool:
    """Return whether every cell that the plan has of a column on a robot is finished, and among the outcomes."""
    ids = (part.cell_id(robot) for part in _parts(column))
    planned = [name for name in ids if name in _planned()]
    return bool(planned) and all(outcomes.states.get(name) == "finished" for name in planned)


@cache
def _planned() -> frozenset[str]:
    return frozenset(cell.id for cell in all_cells())


def pooled_scores(
    outcomes: Outcomes, column: Column, robot: str, endpoint: str, *, without_diverged: bool = False
) -> Floats | None:
    """Return an endpoint of all finished seeds of a column on a robot, `[S]`; None where fewer than two count."""
    cells = pooled(outcomes, column, robot)
    if not cells:
        return None
    values = np.concatenate([scores(cell, endpoint, without_diverged=without_diverged) for cell in cells])
    return values if np.isfinite(values).sum() >= 2 else None


def scores_by_robot(outcomes: Outcomes, column: Column, endpoint: str) -> dict[str, Floats]:
    """Return `pooled_scores` by robot, without the robots that have none."""
    found = {robot: pooled_scores(outcomes, column, robot, endpoint) for robot in ROBOTS}
    return {robot: values for robot, values in found.items() if values is not None}
