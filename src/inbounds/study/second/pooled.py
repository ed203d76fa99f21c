"""The seeds of a column on a robot, from all cells that hold some."""

from __future__ import annotations

import numpy as np

from inbounds.study.analysis import scores
from inbounds.study.cell import ROBOTS
from inbounds.study.outcomes import Column, Floats, Outcome, Outcomes

MORE_SEEDS_OF = {"equal": "equal-more"}  # arm → the arm with the same columns and other seeds


def pooled(outcomes: Outcomes, column: Column, robot: str) -> list[Outcome]:
    """Return the finished cells of a column on a robot: one, or two where the arm has further seeds."""
    arms = (column.arm, MORE_SEEDS_OF.get(column.arm, ""))
    found = (outcomes.find(column._replace(arm=arm), robot) for arm in arms if arm)
    return [outcome for outcome in found if outcome is not None]


def is_whole(outcomes: Outcomes, column: Column, robot: str) -> bool:
    """Return whether every cell that the plan has of a column on a robot is finished."""
    arms = (column.arm, MORE_SEEDS_OF.get(column.arm, ""))
    ids = ("-".join(filter(None, (arm, robot.lower(), *column[1:]))) for arm in arms if arm)
    planned = [i for i in ids if i in outcomes.states]
    return bool(planned) and all(outcomes.states[i] == "finished" for i in planned)


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
