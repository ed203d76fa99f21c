"""The greenhouse obeys its balance, its planner is no worse than a rule, and what is shipped plays what is shipped."""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from inbounds.book.exercises.checks.environment import complaints
from inbounds.book.own_task import constant, greedy, greenhouse_runs, play
from inbounds.book.own_task import greenhouse as house
from inbounds.learning import Trainer
from inbounds.learning.seeding import SeedStreams
from inbounds.study import StudyFolder
from inbounds.study.running.verify import check_sums


@pytest.mark.parametrize(("power", "vent"), [(5.0, 0.0), (-2.0, 0.3), (0.0, 1.0)])
def test_the_step_solves_the_balance(power: float, vent: float) -> None:
    inside, outside, sun = 17.0, 4.0, 2.5

    def balance(_: float, x: np.ndarray) -> np.ndarray:
        return (power + sun - (0.35 + 1.5 * vent) * (x - outside)) / 0.8

    solved = solve_ivp(balance, (0, 0.25), [inside], rtol=1e-10, atol=1e-10).y[0, -1]
    assert np.isclose(house.a_quarter_later(inside, outside, sun, power, vent), solved, atol=1e-7)


def test_the_batch_is_a_sound_environment() -> None:
    assert complaints(house.GreenhouseBatch) == {}


def test_an_integer_seeds_each_greenhouse_with_the_next() -> None:
    envs = house.GreenhouseBatch(3)
    first, _ = envs.reset(seed=7)
    np.testing.assert_array_equal(envs.reset(seed=[7, 8, 9])[0], first)


def test_a_day_lasts_a_day_and_ends_early_where_the_crop_is_lost() -> None:
    envs = house.GreenhouseBatch(2)
    envs.reset(seed=[0, 1])
    warm, frozen = np.float32([[4, 0], [-2, 1]]), []
    for step in range(house.DAY):
        _, _, terminated, truncated, _ = envs.step(warm)
        frozen.append(bool(terminated[1]))
        assert truncated[0] == (step == house.DAY - 1)
    assert any(frozen[:40])


def test_the_crop_is_lost_at_5_and_at_35_degrees() -> None:
    envs = house.GreenhouseBatch(200)
    envs.reset(seed=list(range(200)))
    heats, cools = np.stack([np.linspace(2, 8, 100), np.zeros(100)], -1), np.tile([-2.0, 1.0], (100, 1))
    lost, kept = np.zeros(0), np.zeros(0)
    for _ in range(house.DAY - 1):
        obs, _, terminated, _, info = envs.step(np.float32(np.concatenate([heats, cools])))
        inside = (
            info["final_obs"][:, 0] if terminated.any() else obs[:, 0]
        )  # a lost crop's greenhouse begins anew
        lost, kept = np.append(lost, inside[terminated]), np.append(kept, inside[~terminated])
    assert 4.9 < lost[lost < 20].max() <= 5 < kept.min() < 5.1
    assert 34.9 < kept.max() < 35 <= lost[lost > 20].min() < 35.1


def test_the_planner_is_no_worse_than_any_rule() -> None:
    days = range(20)
    planned = house.planned(days)
    for act in (house.thermostat(), house.thermostat(22, 4, 23), constant([3.5, 0.0])):
        assert (planned >= play(act, house.GreenhouseBatch, days) - 0.05).all()
    finer = house.planned(days, cells=481, steps=65)
    assert 0 <= (finer - planned).mean() < 0.1


def test_a_constant_changes_the_order_where_an_episode_can_end() -> None:
    """Two actors, by sums of rewards: J_c = J_0 + c (1 − e)/(1 − γ), and the order turns at c*."""
    gamma = 0.97

    def of(action: list[float], c: float) -> tuple[float, float]:
        sums, ends = [], []
        for day in range(20):
            envs = house.GreenhouseBatch(1)
            envs.reset(seed=[day])
            total, steps, over = 0.0, 0, False
            while not over:
                _, reward, terminated, truncated, _ = envs.step(np.float32([action]))
                total += gamma**steps * (float(reward[0]) + c)
                steps, over = steps + 1, bool(terminated[0] or truncated[0])
            sums.append(total)
            ends.append(gamma**steps)
        return float(np.mean(sums)), float(np.mean(ends))

    keep, freeze = [5.0, 0.1], [-2.0, 1.0]
    (j_keep, e_keep), (j_freeze, e_freeze) = of(keep, 0), of(freeze, 0)
    assert np.isclose(of(keep, 0.7)[0], j_keep + 0.7 * (1 - e_keep) / (1 - gamma))
    critical = (1 - gamma) * (j_freeze - j_keep) / (e_freeze - e_keep)
    assert of(keep, critical + 0.01)[0] > of(freeze, critical + 0.01)[0]
    assert of(keep, critical - 0.01)[0] < of(freeze, critical - 0.01)[0]


def test_what_is_shipped_plays_what_is_shipped() -> None:
    returns = greenhouse_runs.read_returns()
    days = greenhouse_runs.TESTED[:20]
    for family in greenhouse_runs.FAMILIES:
        policies = greenhouse_runs.policies(family)
        assert returns[family, "greedy"].shape == (len(policies), len(greenhouse_runs.TESTED))
        again = play(greedy(policies[7]), house.GreenhouseBatch, days)
        np.testing.assert_allclose(again, returns[family, "greedy"][7, :20], atol=0.01)
        assert policies[7].config == greenhouse_runs.plan(family)


def test_the_first_epochs_are_trained_again() -> None:
    """The shipped curves are those of this code and this plan, up to another processor's rounding."""
    curves = greenhouse_runs.read_curves()["logit-normal"]
    trainer = Trainer(greenhouse_runs.plan("logit-normal"), house.GreenhouseBatch)
    for epoch in range(2):
        record = trainer.epoch()
        for name in ("return_mean", "kl", "saturation", "explained_variance"):
            np.testing.assert_allclose(record[name], curves[name][:, epoch], rtol=1e-2, atol=1e-3)


def test_no_day_serves_twice() -> None:
    trained_on = {SeedStreams.of(seed).environment for seed in (*range(10), *range(100, 104))}
    tested, chosen_by = set(greenhouse_runs.TESTED), set(greenhouse_runs.CHOSEN_BY)
    assert not trained_on & (tested | chosen_by)
    assert not tested & chosen_by


def test_the_command_writes_what_the_readers_read(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    folder = tmp_path / "greenhouse"
    greenhouse_runs.run(folder, seeds=2, epochs=1, days=(6000, 6001, 6002))
    assert [finding.message for finding in check_sums(StudyFolder(tmp_path))] == [
        "6 of 6 files have their checksums"
    ]
    returns, curves = greenhouse_runs.read_returns(folder), greenhouse_runs.read_curves(folder)
    assert {found.shape for found in returns.values()} == {(2, 3)}
    for family in greenhouse_runs.FAMILIES:
        assert curves[family]["return_mean"].shape == (2, 1)
        assert np.isnan(curves[family]["sigma"]).all() == (family == "beta")
        policy = greenhouse_runs.policies(family, folder)[1]
        again = play(greedy(policy), house.GreenhouseBatch, (6000, 6001, 6002))
        np.testing.assert_allclose(again, returns[family, "greedy"][1], rtol=1e-5)
    assert "beta: done" in capsys.readouterr().out
