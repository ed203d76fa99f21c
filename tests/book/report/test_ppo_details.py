"""The table of details: what is measured has a row with an interval, what is not is named, no row is empty."""

import re
from pathlib import Path

import numpy as np
import pytest

from inbounds.book.report import ppo_details
from inbounds.book.report.ppo_details import DETAILS, effect_table, effects, not_measured, tally_of
from inbounds.study.grid import VARIANTS, Cell, all_cells
from inbounds.study.outcomes import Outcome, Outcomes
from inbounds.study.store import StudyFolder

CELLS = {cell.id: cell for cell in all_cells()}


def outcome(cell: Cell, level: float) -> Outcome:
    """A finished cell whose seeds stay at returns around a level."""
    returns = level + np.linspace(-5, 5, 10)[:, None] + np.zeros(50)
    never = np.zeros(10, np.bool_)
    steps = 2048.0 * np.arange(1, 51)
    episodes = np.full_like(returns, 2.0)
    return Outcome(cell, steps, returns, returns[:, :5], never, {}, {}, {}, episodes, {})


def outcomes(**levels: float) -> Outcomes:
    found = {name: outcome(CELLS[name], level) for name, level in levels.items()}
    return Outcomes(found, {name: "finished" for name in found}, StudyFolder(Path("none")))


def test_a_change_is_compared_with_the_cell_that_differs_in_nothing_else() -> None:
    found = effects(
        outcomes(
            **{
                "standard-hopper-ppo-gaussian": 1000.0,
                "mechanisms-hopper-ppo-gaussian-printed-clip": 400.0,
                "mechanisms-hopper-ppo-beta-entropy-0": 400.0,  # nothing to compare it with
            }
        )
    )
    (effect,) = found
    assert (effect.detail, effect.robot) == ("clip range 0.02 instead of 0.2", "Hopper")
    assert effect.change.low < effect.change.value == -600 < effect.change.high
    assert tally_of(found, effect.detail) == "above in 0 of 1, below in 1, no difference found in 0"
    assert "no entropy bonus instead of 1e-4" in not_measured(found)
    assert effect.detail not in not_measured(found)


def test_the_free_sigma_is_the_second_studys() -> None:
    cells = {"equal-ant-ppo-gaussian": 500.0, "equal-ant-ppo-gaussian-free-std": 700.0}
    (effect,) = effects(outcomes(**cells))
    assert (effect.detail, effect.robot) == ("log σ a free parameter", "Ant")
    assert effect.change.value == 200
    assert "free" in effect.policy


def test_other_steps_are_compared_with_an_equal_start() -> None:
    cells = {
        "equal-hopper-ppo-gaussian": 9.0,
        "equal-hopper-ppo-gaussian-free-std": 100.0,
        "steps-hopper-ppo-gaussian-rate-0.001": 160.0,
        "noise-hopper-ppo-gaussian-noise-0.2": 12.0,
    }
    found = {effect.detail: float(effect.change.value) for effect in effects(outcomes(**cells))}
    assert found == {
        "start with executed noise 0.2 instead of 0.4": pytest.approx(3.0),
        "log σ a free parameter": pytest.approx(91.0),
        "Adam's step size 1e-3": pytest.approx(60.0),
    }


def test_a_row_has_its_line_and_no_row_is_empty() -> None:
    html = effect_table(
        effects(
            outcomes(
                **{
                    "standard-hopper-ppo-gaussian": 1000.0,
                    "mechanisms-hopper-ppo-gaussian-printed-clip": 400.0,
                }
            )
        )
    ).html
    assert "<code>ratio.clamp(1 - 0.02, 1 + 0.02)</code>" in html
    assert re.search(r"<td>−600 \[−\d+, −\d+\]</td><td>below</td>", html)
    assert html.count('<th scope="rowgroup"') == 1
    assert "not yet" not in html


def test_the_text_does_not_depend_on_what_is_there() -> None:
    cells = {"standard-hopper-ppo-beta": 1.0, "mechanisms-hopper-ppo-beta-entropy-0": 2.0}
    assert repr(effect_table(effects(outcomes()))) == repr(effect_table(effects(outcomes(**cells))))


def test_every_detail_has_cells_in_a_plan() -> None:
    for name, detail in DETAILS.items():
        assert set(detail.variants) <= set(VARIANTS), name
        changed = [pair[0] for pair in detail.pairs]
        planned = [c for c in CELLS.values() if c.algorithm == "ppo" and c.variant in detail.variants]
        assert planned or all(column.cell_id("HalfCheetah") in CELLS for column in changed), name
        for pair in detail.pairs:
            assert pair[1].cell_id("HalfCheetah") in CELLS, name


@pytest.mark.parametrize("folder", ["nowhere", "."])
def test_an_empty_folder_is_no_error(folder: str, tmp_path: Path) -> None:
    assert effects(tmp_path / folder) == ()


def test_what_is_shipped_has_effects() -> None:
    found = effects(StudyFolder.shipped().results)
    assert {"start with executed noise 0.4", "clip range 0.02 instead of 0.2"} <= {e.detail for e in found}
    assert all(np.isfinite([e.change.low, e.change.high]).all() for e in found)
    assert ppo_details.told(found[0].change)[1] in ("above", "below", "no difference found")
