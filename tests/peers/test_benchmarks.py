"""The benchmark counts what it says it counts, and runs."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
import torch
from torch.utils.flop_counter import FlopCounterMode

from benchmarks import anatomy, report, run
from benchmarks.contestants import CONTESTANTS, inbounds_config
from benchmarks.floor import Floor
from benchmarks.work import ENVS, Work, flops_per_step, multiply_adds
from tests.made_up_speed import made_up_results, ppo_turns


def test_the_floor_counts_the_operations_of_the_networks() -> None:
    """Against PyTorch's own counter, on one gradient step of the engine."""
    from inbounds.learning import Trainer, ppo
    from inbounds.learning.updates.minibatches import minibatches

    work = Work("Hopper-v5", horizon=128)
    trainer = Trainer(inbounds_config(work, "ppo", 2, "gaussian"))
    rollout = trainer.collector.collect(work.horizon)
    shuffles = [np.random.default_rng(s) for s in range(2)]
    batch = next(minibatches(rollout, rollout.reward, rollout.reward, work.minibatch_size, shuffles))
    with FlopCounterMode(display=False) as counter:
        ppo.loss(trainer.networks, batch, trainer.config.algorithm).backward()
    policy, value = multiply_adds((11, 64, 64, 6)), multiply_adds((11, 64, 64, 1))
    per_step = flops_per_step(work, obs_dim=11, act_dim=3)
    learning = (per_step - 2 * (policy + value)) / work.num_epochs
    # The engine writes the gradient of a bias as a sum, which the counter does not see; products are all there is.
    assert counter.get_total_flops() == pytest.approx(2 * work.minibatch_size * learning, rel=1e-3)


def test_the_replay_is_the_physics_that_was_recorded() -> None:
    work = Work("Ant-v5", horizon=64)
    floor = Floor(work, num_seeds=2)
    turn = floor.turn()
    assert turn["seconds"] == pytest.approx(
        turn["physics_seconds"] + turn["flops"] / turn["flops_per_second"]
    )
    batch, task = floor._batch, floor._task
    batch.state[:] = floor.states[10]
    task.ctrl[:] = floor.controls[10]
    batch.step(nstep=task.frame_skip)
    nq = task.qpos.shape[1]
    time_and_pose = slice(0, 1 + nq)
    alive = np.isclose(
        floor.states[11][:, 0] - floor.states[10][:, 0], floor._task.dt
    )  # not reset in between
    assert alive.any()
    np.testing.assert_array_equal(batch.state[alive, time_and_pose], floor.states[11][alive, time_and_pose])


def humanoid_results() -> dict:
    return made_up_results({"Humanoid-v5": ppo_turns()})


def test_ratios_pair_what_was_measured_together() -> None:
    results = humanoid_results()
    ratios = report.ratio(results, "Humanoid-v5", "inbounds-ppo-10", "sb3-ppo")
    assert ratios.tolist() == [10.0, 10.0, 20.0]  # not the ratio of medians, 10 by accident of the last
    assert report.steps_per_second(results, "Humanoid-v5", "floor", "cpu_seconds").tolist() == [400.0] * 3


def test_the_report_leads_with_ratios_and_hides_nothing() -> None:
    text = report.markdown(humanoid_results())
    assert text.index("## Ratios") < text.index("## Humanoid-v5")
    assert "| 10.00 (10.00 to 20.00) | 10.00 (10.00 to 20.00) | 2.8: met |" in text
    assert "1.50 GB" in text
    assert "sbx-ppo (No module named 'sbx')" in text
    slow = humanoid_results()
    for turn in slow["measurements"]["Humanoid-v5"]["inbounds-ppo-10"]:
        turn["seconds"] *= 10
    assert "2.8: **missed**" in report.markdown(slow)


def test_every_bar_is_about_contestants_and_robots_there_are() -> None:
    assert {bar.env for bar in report.BARS} == set(ENVS)
    assert {name for bar in report.BARS for name in (bar.ours, bar.theirs)} <= CONTESTANTS.keys()


def test_the_parts_of_an_epoch_add_up_and_none_is_missed() -> None:
    import time

    start = time.process_time()
    parts = anatomy.anatomy(Work("Ant-v5", horizon=128), seeds=2, epochs=1)
    assert sum(parts.values()) < 1e6 * (time.process_time() - start) / 256
    expected = {
        "robots: physics",
        "robots: contact forces",
        "acting: network",
        "update: backward",
        "update: Adam",
    }
    assert expected <= parts.keys()
    assert min(parts.values()) > 0
    assert parts["the rest"] < 0.2 * sum(parts.values())
    from inbounds.learning import ppo

    assert torch.autograd.grad.__module__ == "torch.autograd"  # the clocks are gone
    assert ppo.loss.__module__ == "inbounds.learning.ppo"


@pytest.mark.parametrize(
    ("words", "fix"),
    [
        (["--horizon", "100"], "multiple of the minibatch"),
        (["--core", "4096"], "choose one of"),
        (["--python", "sb3-ppo=/nowhere"], "NAME=PATH"),
        (["--repeats", "0"], "at least 1"),
    ],
)
def test_a_wrong_choice_is_explained(words: list[str], fix: str, capsys: pytest.CaptureFixture) -> None:
    with pytest.raises(SystemExit):
        run.parse(words)
    assert fix in capsys.readouterr().err


def test_results_of_some_do_not_replace_those_of_all() -> None:
    tracked = run.parse([]).output
    for words in (["--envs", "Hopper-v5"], ["--contestants", "floor"]):
        assert run.parse(words).output == tracked / "some"
        assert run.parse([*words, "--quick"]).output == tracked / "quick"
        assert run.parse([*words, "--output", "elsewhere"]).output == Path("elsewhere")


@pytest.mark.slow
def test_a_quick_run_measures_and_writes(tmp_path, capsys: pytest.CaptureFixture) -> None:
    names = ["floor", "inbounds-ppo-10", "inbounds-compiled-1", "rltools-ppo", "sb3-ppo", "sbx-ppo"]
    run.main(["--quick", "--output", str(tmp_path), "--contestants", *names])
    results = json.loads((tmp_path / "quick" / "speed.json").read_text())
    measured = results["measurements"]["Hopper-v5"]
    assert set(names) - set(results["unavailable"]) == set(measured)
    assert set(results["unavailable"]) <= {"sbx-ppo", "rltools-ppo"}
    assert measured["inbounds-ppo-10"][0]["steps"] == 2560
    assert all(turn["peak_bytes"] > 1e8 for turns in measured.values() for turn in turns)
    assert "## Ratios" in (tmp_path / "quick" / "speed.md").read_text()
    assert (tmp_path / "quick" / "speed.svg").stat().st_size > 1000
    assert "Ratios" in capsys.readouterr().out


def test_the_readme_quotes_what_was_measured() -> None:
    root = Path(report.__file__).resolve().parents[1]
    results = json.loads((root / "benchmarks" / "results" / "speed.json").read_text(encoding="utf8"))
    quoted = (root / "benchmarks" / "README.md").read_text(encoding="utf8")
    measured = {
        (bar.env.partition("-")[0], "TRPO" if "trpo" in bar.ours else "PPO"): f"{np.median(values):.1f}"
        for bar, values in report.bars(results)
        if bar.theirs.startswith("sb3")
    }
    over_rltools = {
        bar.env.partition("-")[0]: f"{np.median(values):.2f}"
        for bar, values in report.bars(results)
        if bar.theirs == "rltools-ppo"
    }
    assert dict((env, n) for n, env in re.findall(r"(\d+\.\d\d) on\s+(\w+)", quoted)) == over_rltools
    alone = [
        np.median(report.ratio(results, env, "inbounds-compiled-1", "rltools-ppo"))
        for env in results["measurements"]
    ]
    assert f"at {min(alone):.2f} to {max(alone):.2f} of its" in quoted
    assert max(alone) < 1  # "RLtools is ahead"
    found = re.findall(r"(\d+\.\d) on\s+(\w+)( under TRPO)?", quoted)
    assert {(env, "TRPO" if trpo else "PPO"): number for number, env, trpo in found} == measured
