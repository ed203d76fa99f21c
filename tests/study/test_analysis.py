"""The analysis is the protocol's: endpoints, comparisons, references; what is missing stays missing."""

import dataclasses
import re
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from scipy import stats

from inbounds.study import StudyFolder, analysis, read_cell
from inbounds.study.analysis import CONTRASTS, ENDPOINTS, REFERENCE, Contrast
from inbounds.study.grid import ROBOTS, select, study_cells
from inbounds.study.outcomes import Column, Outcome, Outcomes
from tests.study.small import folder_in
from tests.study.synthetic import write_cells

PROTOCOL = Path(__file__).parents[2] / "results" / "PROTOCOL.md"
PPO = Contrast("standard", "ppo", "logit-normal", "gaussian")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> StudyFolder:
    """PPO of arm 1 on all robots, one of its cells with a diverged seed, and one cell of arm 4."""
    made = folder_in(tmp_path_factory.mktemp("study"))
    odd = select(["standard-ant-ppo-beta"])
    write_cells(made, [cell for cell in select(["standard-*-ppo-*"]) if cell not in odd])
    write_cells(made, odd, diverged=(2,))
    write_cells(made, select(["mechanisms-hopper-ppo-beta-entropy-0.01"]))
    return made


@pytest.fixture(scope="module")
def outcomes(folder: StudyFolder) -> Outcomes:
    return Outcomes.read(folder)


def column(family: str) -> Column:
    return Column("standard", "ppo", family)


def test_the_contrasts_are_those_of_the_protocol() -> None:
    table = PROTOCOL.read_text().partition("| Arm | Algorithm | Differences |")[2].partition("\n\n")[0]
    told = set()
    for line in table.splitlines()[2:]:
        _, arms, algorithm, pairs, _ = (part.strip() for part in line.split("|"))
        for arm in re.findall(r"\d (\w+)", arms.partition(",")[0]):
            for pair in pairs.split(", "):
                told.add((arm, algorithm.lower(), *pair.split(" − ")))
    assert told == set(CONTRASTS)
    assert len(CONTRASTS) == len(told)


def test_every_column_of_a_contrast_is_planned_on_every_robot() -> None:
    ids = {cell.id for cell in study_cells()}
    for contrast in CONTRASTS:
        for arm, algorithm, family, _ in contrast.columns:
            assert {f"{arm}-{robot.lower()}-{algorithm}-{family}" for robot in ROBOTS} <= ids
    assert {arm for c in CONTRASTS for arm, *_ in c.columns if c.arm == "printed"} == {"printed"}


def test_every_cell_of_the_fourth_arm_has_a_planned_cell_of_comparison() -> None:
    ids = {cell.id for cell in study_cells()}
    for cell in select(["mechanisms"]):
        plain = Column(cell.arm, cell.algorithm, cell.family, cell.variant).baseline
        assert f"{plain.arm}-{cell.robot.lower()}-{plain.algorithm}-{plain.family}" in ids
    assert Column("mechanisms", "trpo", "beta", "gamma-0.9999").baseline.arm == "beyond"


def test_endpoints_are_means_of_the_rows(folder: StudyFolder, outcomes: Outcomes) -> None:
    (cell,) = select(["standard-hopper-ppo-beta"])
    rows = read_cell(folder.cell_file(cell)).to_pylist()
    outcome = outcomes.finished[cell.id]
    for i, seed in enumerate(cell.seeds):
        returns = [row["return_mean"] for row in rows if row["seed"] == seed]
        greedy = [r["greedy_return"] for r in rows if r["seed"] == seed and r["greedy_return"] is not None]
        expected = {"final": np.mean(returns[450:]), "area": np.mean(returns), "greedy": np.mean(greedy[-5:])}
        for endpoint in ENDPOINTS:
            assert analysis.scores(outcome, endpoint)[i] == pytest.approx(expected[endpoint])
    assert outcome.steps.tolist() == [2048 * (e + 1) for e in range(500)]
    assert outcome.measured["kl"].shape == (10, 51)
    with pytest.raises(ValueError, match="no endpoint 'best'; choose one of final, area, greedy"):
        analysis.scores(outcome, "best")


def test_a_diverged_seed_counts_with_its_last_return_and_is_marked(outcomes: Outcomes) -> None:
    outcome = outcomes.finished["standard-ant-ppo-beta"]
    assert np.flatnonzero(outcome.diverged).tolist() == [2]
    assert (outcome.returns[2, 250:] == outcome.returns[2, 250]).all()
    assert outcome.returns[2, 249] != outcome.returns[2, 250]
    assert analysis.scores(outcome, "final")[2] == pytest.approx(outcome.returns[2, 250])
    kept, dropped = (
        analysis.estimate(outcome, "final"),
        analysis.estimate(outcome, "final", without_diverged=True),
    )
    assert kept is not None
    assert dropped is not None
    assert (kept.n, kept.diverged, kept.missing) == (10, 1, 0)
    assert (dropped.n, dropped.diverged, dropped.missing) == (9, 0, 1)
    band = analysis.curve(outcome)
    assert band is not None
    assert (band.diverged, band.value.shape) == (1, (500,))
    row = analysis.differences(outcomes, Contrast("standard", "ppo", "beta", "gaussian"), "area")["Ant"]
    assert row.difference is not None
    assert (row.difference.diverged, row.difference.n) == (1, 10)


def test_aggregates_say_how_many_seeds_diverged(outcomes: Outcomes) -> None:
    contrast = Contrast("standard", "ppo", "beta", "gaussian")
    found = [
        analysis.aggregate(outcomes, column("beta"), "final"),
        analysis.improvement(outcomes, contrast, "final"),
        analysis.by_way(outcomes.finished["standard-ant-ppo-beta"])["median"],
    ]
    profile = analysis.profile(outcomes, column("beta"), "final", [0.0, 1.0])
    assert profile is not None
    assert [estimate and estimate.diverged for estimate in (*found, profile.share)] == [1, 1, 1, 1]
    without = [
        analysis.aggregate(outcomes, column("beta"), "final", without_diverged=True),
        analysis.aggregate(outcomes, column("logit-normal"), "final"),
    ]
    assert [estimate and estimate.diverged for estimate in without] == [0, 0]


def test_differences_are_of_means_and_corrected_over_six_robots(outcomes: Outcomes) -> None:
    rows = analysis.differences(outcomes, PPO, "final")
    assert list(rows) == list(ROBOTS)
    p = []
    for robot, row in rows.items():
        a, b = (analysis.scores(outcomes.find(c, robot), "final") for c in PPO.columns)  # type: ignore[arg-type]
        assert row.difference is not None
        assert row.difference.value == pytest.approx(a.mean() - b.mean())
        assert row.difference.statistic == "difference of means"
        assert row.p_value == pytest.approx(stats.ttest_ind(a, b, equal_var=False).pvalue, abs=0.02)
        p.append(row.p_value)
    ordered = np.maximum.accumulate(np.sort(p) * np.arange(6, 0, -1)).clip(max=1)
    assert np.sort([row.p_adjusted for row in rows.values()]) == pytest.approx(ordered)


def test_no_number_depends_on_what_else_is_finished(outcomes: Outcomes, tmp_path: Path) -> None:
    few = folder_in(tmp_path)
    write_cells(few, select(["standard-walker2d-ppo-gaussian", "standard-walker2d-ppo-logit-normal"]))
    alone = Outcomes.read(few)
    for as_planned in (True, False):
        lone, among = (
            analysis.differences(o, PPO, "final", as_planned=as_planned) for o in (alone, outcomes)
        )
        assert lone["Walker2d"].difference == among["Walker2d"].difference
        assert lone["Walker2d"].p_value == among["Walker2d"].p_value
    assert lone["Walker2d"].p_adjusted == pytest.approx(6 * lone["Walker2d"].p_value)
    assert [lone[robot].difference is None for robot in ROBOTS] == [r != "Walker2d" for r in ROBOTS]
    name = "standard-walker2d-ppo-gaussian"
    assert analysis.estimate(alone.finished[name], "area") == analysis.estimate(
        outcomes.finished[name], "area"
    )


def test_aggregates_wait_for_all_robots(outcomes: Outcomes, folder: StudyFolder) -> None:
    assert analysis.aggregate(outcomes, column("beta"), "final") is not None
    five = Outcomes.read(folder, [cell for cell in select(["standard"]) if cell.robot != "Ant"])
    assert analysis.aggregate(five, column("beta"), "final") is None
    assert analysis.improvement(five, PPO, "final") is None
    assert analysis.profile(five, column("beta"), "final", [0.0, 1.0]) is None
    assert list(analysis.references(five)) == [robot for robot in ROBOTS if robot != "Ant"]


def test_normalised_scores_are_0_at_the_first_epoch_and_1_at_the_gaussians_end(outcomes: Outcomes) -> None:
    normal = analysis.normalized(outcomes, REFERENCE, "final")
    assert normal is not None
    assert [np.mean(x) for x in normal.values()] == pytest.approx([1.0] * 6)
    for robot, (zero, one) in analysis.references(outcomes).items():
        outcome = outcomes.find(REFERENCE, robot)
        assert outcome is not None
        assert (zero, one) == pytest.approx((outcome.returns[:, 0].mean(), outcome.returns[:, 450:].mean()))
        beta = outcomes.find(column("beta"), robot)
        other = analysis.normalized(outcomes, column("beta"), "greedy")
        assert beta is not None
        assert other is not None
        assert other[robot] == pytest.approx((analysis.scores(beta, "greedy") - zero) / (one - zero))


def test_a_robot_whose_references_are_not_in_order_is_left_out(
    outcomes: Outcomes, monkeypatch: pytest.MonkeyPatch
) -> None:
    known = analysis.references(outcomes) | {"Swimmer": (5.0, 5.0)}
    monkeypatch.setattr(analysis, "references", lambda _: known)
    found = analysis.normalized(outcomes, column("beta"), "final")
    assert found is not None
    assert list(found) == [robot for robot in ROBOTS if robot != "Swimmer"]


def test_probability_of_improvement_and_profile_are_of_all_runs(outcomes: Outcomes) -> None:
    better = analysis.improvement(outcomes, PPO, "final")
    assert better is not None
    wins = []
    for robot in ROBOTS:
        a, b = (analysis.scores(outcomes.find(c, robot), "final") for c in PPO.columns)  # type: ignore[arg-type]
        wins.append((a[:, None] > b).mean())
    assert better.value == pytest.approx(np.mean(wins))
    profile = analysis.profile(outcomes, REFERENCE, "final", [-9.0, 1.0, 9.0])
    assert profile is not None
    assert profile.share.value[[0, 2]].tolist() == [1, 0]


def test_changes_are_against_the_cell_of_comparison(outcomes: Outcomes) -> None:
    changed = outcomes.finished["mechanisms-hopper-ppo-beta-entropy-0.01"]
    plain = outcomes.finished["standard-hopper-ppo-beta"]
    found = analysis.change(outcomes, changed, "final")
    assert found is not None
    gap = analysis.scores(changed, "final").mean() - analysis.scores(plain, "final").mean()
    assert found.value == pytest.approx(gap)
    alone = Outcomes({changed.cell.id: changed}, {}, outcomes.folder)
    assert analysis.change(alone, changed, "final") is None


def test_final_policies_are_read_by_their_way_to_act(outcomes: Outcomes) -> None:
    outcome = outcomes.finished["standard-hopper-ppo-beta"]
    assert list(outcome.ways) == ["mean", "median", "mode", "sample"]
    gaps = [outcome.ways["mode"] - outcome.ways["mean"], outcome.ways["sample"] - outcome.ways["mean"]]
    assert [float(np.round(gap.mean(), -1)) for gap in gaps] == [20.0, 30.0]
    found = analysis.by_way(outcome)["mode"]
    assert found is not None
    assert found.value == pytest.approx(outcome.ways["mode"].mean())
    assert outcomes.finished["mechanisms-hopper-ppo-beta-entropy-0.01"].ways == {}


def test_a_cell_that_is_not_whole_is_named_and_not_used(folder: StudyFolder, tmp_path: Path) -> None:
    few = folder_in(tmp_path)
    cells = select(["standard-hopper-ppo-*"])
    write_cells(few, cells)
    few.policy_files(cells[0])[0].write_bytes(b"other policies")
    found = Outcomes.read(few, cells)
    assert found.states[cells[0].id] == "damaged"
    assert list(found.finished) == [cell.id for cell in cells[1:]]


def test_a_pace_is_what_the_epochs_add_up_to() -> None:
    """Ten epochs of a hundred steps, two seeds: counted by hand."""
    episodes = np.array([[2.0] * 5 + [1.0] * 5, [0.0] * 5 + [4.0] * 5])
    returns = np.array([[30.0] * 5 + [80.0] * 5, [np.nan] * 5 + [5.0] * 5])
    outcome = dataclasses.replace(
        outcome_of_nothing(), steps=100.0 * np.arange(1, 11), returns=returns, episodes=episodes
    )
    pace = outcome.pace(5)
    np.testing.assert_allclose(pace.steps, [[50.0, 100.0], [np.inf, 25.0]])
    np.testing.assert_allclose(pace.reward, [[0.6, 0.8], [0.0, 0.2]])
    whole = outcome.pace(10)
    np.testing.assert_allclose(whole.steps[:, 0], [1000 / 15, 1000 / 20])
    np.testing.assert_allclose(whole.reward[:, 0], [700 / 1000, 100 / 1000])
    for block in (3, 0):
        with pytest.raises(ValueError, match="choose a divisor of 10"):
            outcome.pace(block)


def outcome_of_nothing() -> Outcome:
    cell, *_ = select(["standard-hopper-ppo-beta"])
    empty = np.empty((0, 0))
    return Outcome(cell, np.empty(0), empty, empty, np.empty(0, np.bool_), {}, {}, {}, empty, {})


def test_final_policies_have_lengths_by_their_way_to_act(outcomes: Outcomes) -> None:
    outcome = outcomes.finished["standard-hopper-ppo-beta"]
    assert list(outcome.lengths) == list(outcome.ways)
    assert all(lengths.shape == (10,) for lengths in outcome.lengths.values())
    table = pq.read_table(outcomes.folder.policy_files(outcome.cell)[1]).to_pylist()
    by_hand = [row["length"] for row in table if row["greedy"] == "mode" and row["seed"] == 3]
    assert outcome.lengths["mode"][3] == pytest.approx(np.mean(by_hand))
