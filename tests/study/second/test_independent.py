"""The package's analysis of the second study beside one that was written from the protocol's text alone."""

import importlib
from pathlib import Path

import hypothesis.extra.numpy as hnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from inbounds.study import StudyFolder, second, statistics
from inbounds.study.grid import Cell, second_cells
from inbounds.study.outcomes import Column, Outcomes
from inbounds.study.second import over_robots
from tests.study import synthetic
from tests.study.second import independent
from tests.study.small import folder_in

FEWER = 10_000  # resamples and permutations, on both sides
PRIMARY = [
    cell
    for cell in second_cells()
    if cell.algorithm == "ppo"
    and cell.arm in ("equal", "equal-more")
    and (cell.family, cell.variant) in {("gaussian", "free-std"), ("beta", ""), ("logit-normal", "")}
]
COLUMNS = {
    "gaussian": second.GAUSSIAN,
    **{law: Column("equal", "ppo", law) for law in independent.LAWS},
}


@pytest.fixture(autouse=True)
def _fewer(monkeypatch: pytest.MonkeyPatch) -> None:
    module = importlib.import_module("inbounds.study.second.primary")
    monkeypatch.setattr(module, "RESAMPLES", FEWER)
    monkeypatch.setattr(module, "PERMUTATIONS", FEWER - 1)
    monkeypatch.setattr(over_robots, "RESAMPLES", FEWER)


def made_up(path: Path, seed: int, monkeypatch: pytest.MonkeyPatch, diverged: tuple[int, ...]) -> StudyFolder:
    """Write the primary cells with levels and noise of the margins' size: every verdict can come of it."""
    folder, rng, table = folder_in(path), np.random.default_rng(seed), independent.yardsticks()
    sides = {(r, f): rng.uniform(-1.2, 1.2) for r in table for f in ("gaussian", "beta", "logit-normal")}

    def level(cell: Cell) -> float:
        return table[cell.robot].best_final + table[cell.robot].margin_final * sides[cell.robot, cell.family]

    monkeypatch.setattr(synthetic, "level_of", level)
    for robot, yardstick in table.items():
        cells = [cell for cell in PRIMARY if cell.robot == robot]
        noise = yardstick.margin_final * rng.uniform(0.3, 1.5)
        synthetic.write_cells(folder, cells, diverged=diverged, noise=noise)
    return folder


def same_numbers(folder: StudyFolder, root: Path, draws: int = FEWER, **how: bool) -> set[str]:
    """Hold the 24 rows against each other; return the verdicts that occur."""
    theirs = second.primary(Outcomes.read(folder, second_cells()), **how)
    mine = independent.primary(root, resamples=draws, permutations=draws - 1, **how)
    assert [(row.law, row.endpoint, row.robot) for row in mine] == [
        (r.law, r.endpoint, r.robot) for r in theirs
    ]
    p_values = np.array([row.p_value for row in theirs])
    adjusted = np.array([row.p_adjusted for row in theirs])
    np.testing.assert_allclose(independent.holm(p_values), adjusted, rtol=1e-12)
    narrower, extreme = [], []
    for ours, row in zip(mine, theirs, strict=True):
        assert ours.margin == row.margin
        assert (row.difference is None) == np.isnan(ours.difference)
        if row.difference is None:
            continue
        assert row.difference.value == pytest.approx(ours.difference, rel=1e-9, abs=1e-9)
        error = end_error(ours, draws)
        assert row.difference.low == pytest.approx(ours.low, abs=6 * error)
        assert row.difference.high == pytest.approx(ours.high, abs=6 * error)
        narrower.append(
            (ours.high - ours.low - (row.difference.high - row.difference.low)) / (error * np.sqrt(2))
        )
        assert (ours.verdict is None) == (row.finding == "")
        if ours.verdict is None:
            continue
        spread = np.sqrt(2 * ours.p * (1 - ours.p) / draws)  # of the difference of two estimates of p
        assert row.p_value == pytest.approx(ours.p, abs=6 * spread + 2 / draws)
        extreme.append((row.p_value - ours.p) / (spread + 2 / draws))
        found = float(row.difference.low), float(row.difference.high), float(row.difference.value)
        assert row.finding == independent.judged(*found, row.p_adjusted, ours.margin)
        near = min(abs(abs(end) - ours.margin) for end in (ours.low, ours.high)) < 6 * error
        if not near and abs(ours.p_holm - 0.05) > 24 * (6 * spread + 2 / draws):
            assert row.finding == ours.verdict
    # Over all rows together a systematic difference shows that hides in the noise of each.
    for z in (narrower, extreme):
        assert not z or abs(np.sum(z)) < 5 * np.sqrt(len(z))
    return {row.finding for row in theirs}


def end_error(row: independent.Row, draws: int) -> float:
    """Return the Monte-Carlo standard error of the difference between two estimates of an interval's end.

    A quantile at the share a of R replicates has the error √(a (1 − a) / R) over the density there: a Normal's.
    """
    share = row.share
    z = stats.norm.isf(share)
    density = stats.norm.pdf(z) / ((row.high - row.low) / (2 * z))
    return float(np.sqrt(2 * share * (1 - share) / draws) / density)


@pytest.mark.parametrize(("seed", "diverged"), [(0, ()), (1, (3,))])
def test_the_primary_comparison(seed, diverged, tmp_path, monkeypatch) -> None:
    folder = made_up(tmp_path, seed, monkeypatch, diverged)
    verdicts = same_numbers(folder, tmp_path / "results")
    assert len(verdicts) >= 3  # or the comparison of verdicts would say little
    if diverged:
        same_numbers(folder, tmp_path / "results", without_diverged=True)
    same_aggregates(folder, tmp_path / "results")
    same_starts(folder, tmp_path / "results")


def same_aggregates(folder: StudyFolder, root: Path) -> None:
    outcomes = Outcomes.read(folder, second_cells())
    for endpoint in independent.ENDPOINTS:
        mine = independent.aggregates(root, endpoint, resamples=FEWER)
        found = {law: second.aggregate(outcomes, column, endpoint) for law, column in COLUMNS.items()}
        assert {law for law, theirs in found.items() if theirs is not None} == set(mine.iqm)
        for law, (value, low, high) in mine.iqm.items():
            alike(found[law], value, low, high)
        for law, (value, low, high) in mine.improvement.items():
            alike(second.improvement(outcomes, COLUMNS[law], endpoint), value, low, high)


@pytest.mark.parametrize("endpoint", independent.ENDPOINTS)
def test_aggregates_are_of_the_column_and_endpoint_asked_for(endpoint: str, monkeypatch) -> None:
    """Skewed scores, other ones for each: IQM and mean differ, and so do the two sides of an improvement."""
    rng, few = np.random.default_rng(3), {}
    for column, median in zip(COLUMNS.values(), (1.0, 1.6, 0.7), strict=True):
        for each in independent.ENDPOINTS:
            scale = median * (0.5 if each == "area" else 1.0)
            few[column, each] = {
                robot: scale * rng.lognormal(0.0, 0.5, 20) for robot in independent.yardsticks()
            }
    monkeypatch.setattr(over_robots, "normalized", lambda _, column, each: few[column, each])
    outcomes = Outcomes({}, {}, StudyFolder())
    groups = {law: list(few[column, endpoint].values()) for law, column in COLUMNS.items()}
    for law, column in COLUMNS.items():
        alike(second.aggregate(outcomes, column, endpoint), *independent.iqm(groups[law], rng, FEWER))
    for law in independent.LAWS:
        theirs = second.improvement(outcomes, COLUMNS[law], endpoint)
        alike(theirs, *independent.improvement(groups[law], groups["gaussian"], rng, FEWER))


def alike(theirs: statistics.Estimate, value: float, low: float, high: float) -> None:
    assert theirs.value == pytest.approx(value, rel=1e-9)
    error = np.sqrt(2 * 0.025 * 0.975 / FEWER) / stats.norm.pdf(1.96) * (high - low) / (2 * 1.96)
    assert (theirs.low, theirs.high) == pytest.approx((low, high), abs=6 * error)


def same_starts(folder: StudyFolder, root: Path) -> None:
    outcomes = Outcomes.read(folder, second_cells())
    for (column, robot), mine in independent.manipulations(root, more_seeds=False).items():
        theirs = second.starts(outcomes, named(column), robot)
        wanted = {"action_std": mine.noise, "saturation": mine.saturation, "return": mine.first_return}
        assert theirs == pytest.approx(wanted, rel=1e-6)


def named(column: independent.Column) -> Column:
    """Return the package's name of a column."""
    arms = {block: arm for arm, block in independent.BLOCKS.items()}
    variant = {"E": f"noise-{column.noise}", "F": f"rate-{column.rate:g}"}
    plain = "free-std" if column.free else ""
    arm = arms.get(column.block, "equal")
    return Column(arm, column.algorithm, column.law, variant.get(column.block, plain))


def test_the_results_that_are_there() -> None:
    folder = StudyFolder.shipped()
    root = independent.PROTOCOL.parent
    assert independent.read(root)
    same_numbers(folder, root)
    same_aggregates(folder, root)
    same_starts(folder, root)


holes = hnp.arrays(
    float, (3, 500), elements=st.sampled_from([np.nan, 1.0, 2.5, -7.0]), fill=st.sampled_from([np.nan, 4.0])
)


@given(holes)
def test_missing_returns(returns) -> None:
    runs = independent.Runs((1, 2, 3), returns, *np.zeros((3, 3)))
    carried = statistics.carry_forward(returns)
    for name, theirs in (("final", statistics.final_score), ("area", statistics.area_under_curve)):
        np.testing.assert_allclose(runs.endpoint(name), theirs(carried), rtol=1e-12)
