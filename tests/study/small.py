"""Cells that take a second: the code is that of the real ones, the robot one that soon falls."""

from pathlib import Path
from typing import Any

from inbounds.study import Cell, StudyFolder

TINY = (("horizon", 64), ("minibatch_size", 32), ("num_epochs", 1))


def small_cell(
    algorithm: str = "ppo", family: str = "gaussian", robot: str = "Hopper", **values: Any
) -> Cell:
    return Cell(
        "test", algorithm, family, robot, **{"seeds": (0, 1), "epochs": 30, "overrides": TINY} | values
    )


def folder_in(path: Path) -> StudyFolder:
    return StudyFolder(path / "results", path / "work")


def stop_after(epochs: int) -> Any:
    """A wish to stop that comes after so many epochs."""
    left = [epochs]

    def stop() -> bool:
        left[0] -= 1
        return left[0] <= 0

    return stop
