"""The table of the fourth arm: cells that are there, cells that are not, and what is not planned."""

import re
from pathlib import Path

import numpy as np
import pytest

from inbounds.book.ppo_details import DETAILS, NOT_PLANNED, NOT_RUN, what_details_cost
from inbounds.study.grid import ARMS, VARIANTS, Cell
from inbounds.study.outcomes import Outcome, Outcomes
from inbounds.study.store import StudyFolder


def outcome(cell: Cell, level: float) -> Outcome:
    """A finished cell whose seeds stay at returns around a level."""
    returns = level + np.linspace(-5, 5, 10)[:, None] + np.zeros(50)
    never = np.zeros(10, np.bool_)
    steps = 2048.0 * np.arange(1, 51)
    episodes = np.full_like(returns, 2.0)
    return Outcome(cell, steps, returns, returns[:, :5], never, {}, {}, {}, episodes, {})


def find(arm: str, robot: str, family: str, variant: str = "") -> Cell:
    (cell,) = (
        c for c in ARMS[arm] if (c.algorithm, c.robot, c.family, c.variant) == ("ppo", robot, family, variant)
    )
    return cell


def outcomes(*cells: tuple[Cell, float]) -> Outcomes:
    return Outcomes({cell.id: outcome(cell, level) for cell, level in cells}, {}, StudyFolder(Path("none")))


def test_a_finished_cell_shows_its_difference_from_the_cell_of_comparison() -> None:
    plain, changed = (
        find("standard", "Hopper", "gaussian"),
        find("mechanisms", "Hopper", "gaussian", "printed-clip"),
    )
    table = what_details_cost(outcomes((plain, 1000.0), (changed, 400.0)))
    cell = table.rows["clip range 0.02", "Hopper"][table.families.index("gaussian")]
    value, low, high = map(float, re.findall(r"-?\d+", cell.replace("−", "-")))
    assert value == -600
    assert low < -600 < high
    others = [cell for row in table.rows.values() for cell in row]
    assert len(others) - sum(cell in (NOT_RUN, NOT_PLANNED) for cell in others) == 1
    assert "−600" in table._repr_html_()


def test_half_a_comparison_is_not_run() -> None:
    table = what_details_cost(outcomes((find("mechanisms", "Hopper", "gaussian", "printed-clip"), 400.0)))
    assert {cell for row in table.rows.values() for cell in row} == {NOT_RUN, NOT_PLANNED}


def test_the_text_does_not_depend_on_what_is_there() -> None:
    pair = (
        (find("standard", "Hopper", "beta"), 1.0),
        (find("mechanisms", "Hopper", "beta", "entropy-0"), 2.0),
    )
    assert repr(what_details_cost(outcomes())) == repr(what_details_cost(outcomes(*pair)))


def test_the_plan_is_the_studys() -> None:
    assert set(DETAILS) <= set(VARIANTS)
    assert {v for v in VARIANTS if v.startswith(("printed-", "entropy-"))} == set(DETAILS)
    table = what_details_cost(outcomes())
    beta = table.families.index("beta")
    for robot in ("HalfCheetah", "Hopper"):
        assert table.rows["gradients not clipped", robot][beta] == NOT_PLANNED
        assert table.rows["no entropy bonus", robot][beta] == NOT_RUN


@pytest.mark.parametrize("folder", ["nowhere", "."])
def test_an_empty_folder_is_no_error(folder: str, tmp_path: Path) -> None:
    assert "Not yet run, on any robot" in what_details_cost(tmp_path / folder)._repr_html_()
