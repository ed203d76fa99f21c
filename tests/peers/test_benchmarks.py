"""The benchmark counts what it says it counts, and runs."""

import json
import os
import re
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
from torch.utils.flop_counter import FlopCounterMode

from benchmarks import anatomy, published, report, run
from benchmarks.contestants import CONTESTANTS, inbounds_config
from benchmarks.floor import Floor
from benchmarks.work import ENVS, Work, flops_per_step, multiply_adds
from tests.made_up_speed import made_up_results, ppo_turns, turn


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
    measured = floor.turn()
    assert measured["seconds"] == pytest.approx(
        measured["physics_seconds"] + measured["flops"] / measured["flops_per_second"]
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
    for each in slow["measurements"]["Humanoid-v5"]["inbounds-ppo-10"]:
        each["seconds"] *= 10
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
    assert tracked == published.RESULTS
    for words in (["--repeats", "1"], ["--horizon", "256"]):
        assert run.parse(words).output == tracked / "some"
    for words in (["--envs", "Hopper-v5"], ["--contestants", "floor"]):
        assert run.parse(words).output == tracked / "some"
        assert run.parse([*words, "--quick"]).output == tracked / "quick"
        assert run.parse([*words, "--output", "elsewhere"]).output == Path("elsewhere")


class MadeUpWorker:
    """Measures nothing; one name is not there, another ends in the second turn on Ant, the third is stopped there."""

    absent = dying = stopped = ""

    def __init__(self, name: str, work: Work, core: int, python: str) -> None:
        self.name, self.env, self.turns = name, work.env, 0

    def ready(self) -> str | None:
        return "No module named 'made_up'" if self.name == self.absent else None

    def turn(self) -> dict:
        self.turns += 1
        if self.env == "Ant-v5" and self.name == self.stopped:
            raise KeyboardInterrupt
        if self.env == "Ant-v5" and self.turns == 2 and self.name == self.dying:
            return {"unavailable": "Killed"}
        return turn(2048, self.turns)  # not all the same, or the plot has no extent

    def close(self) -> None: ...


@pytest.fixture
def results_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder that stands for the tracked one, with its table."""
    folder = tmp_path / "results"
    folder.mkdir()
    shutil.copy(published.RESULTS / "speed.json", folder)
    monkeypatch.setattr(published, "RESULTS", folder)
    monkeypatch.setattr(run, "Worker", MadeUpWorker)
    monkeypatch.setattr(run, "versions", lambda _: {})
    return folder


def speed_in(folder: Path) -> dict:
    found: dict = json.loads((folder / "speed.json").read_text(encoding="utf8"))
    return found


def test_a_run_of_all_replaces_the_table(results_folder: Path, capsys: pytest.CaptureFixture) -> None:
    run.main(["--output", str(results_folder)])
    assert speed_in(results_folder)["versions"] == {}
    assert "Results go to" not in capsys.readouterr().out
    assert list(speed_in(results_folder / "some")["measurements"]) == list(ENVS[:3])  # after the third robot


def test_a_run_without_a_contestant_of_the_table_leaves_it(
    results_folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    monkeypatch.setattr(MadeUpWorker, "absent", "rltools-ppo")
    before = speed_in(results_folder)
    run.main(["--output", str(results_folder)])
    assert speed_in(results_folder) == before
    assert set(speed_in(results_folder / "some")["unavailable"]) == {"rltools-ppo"}
    said = " ".join(capsys.readouterr().out.split())
    assert "rltools-ppo does not take part: No module named 'made_up'" in said
    assert f"rltools-ppo did not take part. {run.HOW_TO_ADD}" in said
    assert not (results_folder / "speed.md").exists()


def test_what_ends_between_two_turns_is_absent_from_there_on(
    results_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(MadeUpWorker, "dying", "sb3-ppo")
    run.main(["--output", str(results_folder)])
    found = speed_in(results_folder / "some")
    assert [env for env, turns in found["measurements"].items() if "sb3-ppo" in turns] == list(ENVS[:2])
    assert found["unavailable"] == {"sb3-ppo": "it ended on Ant-v5: Killed"}
    assert "sb3-ppo (it ended on Ant-v5: Killed)" in report.markdown(found)


def test_an_interrupted_run_keeps_its_robots(results_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(MadeUpWorker, "stopped", "floor")
    before = speed_in(results_folder)
    with pytest.raises(KeyboardInterrupt):
        run.main(["--output", str(results_folder)])
    assert speed_in(results_folder) == before
    assert list(speed_in(results_folder / "some")["measurements"]) == list(ENVS[:2])


@pytest.mark.parametrize("last_words", ["", "print('{', end='')", "raise MemoryError('too little')"])
def test_a_process_that_ends_after_its_warm_up_says_why(
    last_words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    code = f"print('{{\"ready\": true}}', flush=True)\n{last_words}"
    start = run.subprocess.Popen
    monkeypatch.setattr(run.subprocess, "Popen", lambda _, **how: start([sys.executable, "-c", code], **how))
    worker = run.Worker("floor", Work("Hopper-v5"), 0, sys.executable)
    assert worker.ready() is None
    worker._process.wait()  # or it might still read
    why = worker.turn()["unavailable"]
    assert why == ("MemoryError: too little" if "Memory" in last_words else "it ended in silence")
    worker.close()


def test_one_that_says_more_than_a_pipe_holds_is_not_held_up(monkeypatch: pytest.MonkeyPatch) -> None:
    code = (
        "import signal, sys\nsignal.alarm(20)\n"  # held up, it ends by that, and has no answer
        "print(300_000 * 'warning ', file=sys.stderr)\nprint('{\"ready\": true}', flush=True)\n"
        "input()\nprint('{\"steps\": 7}', flush=True)\nsys.exit('enough')"
    )
    start = run.subprocess.Popen
    monkeypatch.setattr(run.subprocess, "Popen", lambda _, **how: start([sys.executable, "-c", code], **how))
    worker = run.Worker("floor", Work("Hopper-v5"), 0, sys.executable)
    assert worker.ready() is None
    assert worker.turn() == {"steps": 7}
    assert worker.turn() == {"unavailable": "enough"}
    worker.close()


def test_the_anatomy_says_what_it_takes_where_nothing_can_be_pinned(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    """As on macOS."""
    monkeypatch.delattr(os, "sched_getaffinity")
    for words, code in ((["--help"], 0), ([], 2)):
        with pytest.raises(SystemExit) as ended:
            anatomy.main(words)
        assert ended.value.code == code
    assert "takes Linux" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        run.parse([])
    assert "benchmarks.run pins everything" in capsys.readouterr().err


@pytest.mark.slow
def test_a_quick_run_measures_and_writes(tmp_path, capsys: pytest.CaptureFixture) -> None:
    names = ["floor", "inbounds-ppo-10", "inbounds-compiled-1", "rltools-ppo", "sb3-ppo", "sbx-ppo"]
    run.main(["--quick", "--output", str(tmp_path), "--contestants", *names])
    results = json.loads((tmp_path / "quick" / "speed.json").read_text())
    measured = results["measurements"]["Hopper-v5"]
    assert set(names) - set(results["unavailable"]) == set(measured)
    assert set(results["unavailable"]) <= {"sbx-ppo", "rltools-ppo"}
    assert measured["inbounds-ppo-10"][0]["steps"] == 2560
    assert all(each["peak_bytes"] > 1e8 for turns in measured.values() for each in turns)
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
