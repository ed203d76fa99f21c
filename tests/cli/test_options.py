import dataclasses
import re
import subprocess
import sys
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import inbounds
from inbounds.cli import options, studying
from inbounds.learning import FAMILIES, NetworkConfig, PolicyConfig, TrainConfig, preset
from inbounds.learning.config import ALGORITHMS
from inbounds.learning.families import Limits
from tests.cli.small import run, succeeds

PRESETS = get_args(options.PresetName)


def option_names(algo: str) -> set[str]:
    """What --help must show, from the configurations themselves."""
    own = {"env", "seeds", "epochs", "algorithm", "policy", "network"}
    sections = {
        "": {f.name for f in dataclasses.fields(TrainConfig)} - own,
        "algorithm.": {f.name for f in dataclasses.fields(ALGORITHMS[algo][0])},
        "policy.": {f.name for f in dataclasses.fields(PolicyConfig)} - {"family", "limits"},
        "policy.limits.": {f.name for f in dataclasses.fields(Limits)},
        "network.": {f.name for f in dataclasses.fields(NetworkConfig)},
    }
    names = {f"--{prefix}{name.replace('_', '-')}" for prefix, fields in sections.items() for name in fields}
    return names | {"--policy", "--seeds", "--epochs", "--preset", "--algo", "--out", "--tensorboard"}


def test_the_choices_are_those_of_the_tables() -> None:
    assert set(get_args(options.FamilyName)) == set(FAMILIES)
    assert set(get_args(options.AlgorithmName)) == set(ALGORITHMS)
    for name in PRESETS:
        preset(name)


@pytest.mark.parametrize("algo", list(ALGORITHMS))
def test_help_shows_every_value_with_its_meaning_and_ends_in_examples(
    algo: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "100")  # one column of options
    before, examples = succeeds(["train", "--algo", algo, "--help"]).split("\nexamples:\n")
    meanings = {}
    for chunk in re.split(r"\n\s*(?=--\w)", before)[1:]:
        names, meaning = chunk.split("\n", 1)
        meanings[names.split()[0].rstrip(",")] = " ".join(meaning.split())
    assert meanings.keys() == option_names(algo)
    for name, meaning in meanings.items():
        text, default = meaning.split("(default:", 1)
        assert len(text) > 5, name  # its docstring
        assert default, name
    assert "inbounds train HalfCheetah-v5 --policy logit-normal" in examples


def test_help_shows_the_values_of_the_preset(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    printed = succeeds(["train", "--preset", "as-printed", "--help"])
    common = succeeds(["train", "--help"])
    assert "|r − 1| = ε. (default: 0.02)" in printed
    assert "|r − 1| = ε. (default: 0.2)" in common


@pytest.mark.parametrize("command", ["train", "watch", "bench", None])
def test_each_command_has_help_and_examples(command: str | None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("inbounds.cli.benchmark.find_root", lambda: None)
    text = succeeds([command, "--help"] if command else [])
    assert f"\nexamples:\n  inbounds {command or 'train'}" in text


@pytest.mark.parametrize("algo", list(ALGORITHMS))
@pytest.mark.parametrize("name", PRESETS)
def test_a_command_line_is_its_preset(algo: str, name: str) -> None:
    words = ["train", "Ant-v5", "--policy", "beta", "--algo", algo, "--preset", name, "--seeds", "3"]
    command = options.parse([*words, "--epochs", "7"])
    assert isinstance(command, options.Train)
    config = command.train_config()
    assert config == preset(name, "Ant-v5", policy="beta", algo=algo, seeds=3, epochs=7)
    assert type(config) is TrainConfig
    assert type(config.policy) is PolicyConfig


def test_any_value_can_be_overridden() -> None:
    words = (
        "train Hopper-v5 --algorithm.clip-range 0.1 --algorithm.max-grad-norm None --policy.initial-std 0.5"
    )
    words += (
        " --policy.limits.log-std-max 0.5 --network.hidden-sizes 32 16 --no-normalize-obs --preset=as-printed"
    )
    words += " --action-mode raw"
    command = options.parse(words.split())
    assert isinstance(command, options.Train)
    config, printed = command.train_config(), preset("as-printed", "Hopper-v5")
    assert config == dataclasses.replace(
        printed,
        algorithm=dataclasses.replace(printed.algorithm, clip_range=0.1),
        policy=PolicyConfig(initial_std=0.5, limits=Limits(log_std_max=0.5)),
        network=dataclasses.replace(printed.network, hidden_sizes=(32, 16)),
        action_mode="raw",
    )
    assert command.run_dir() == Path("runs/Hopper-v5-logit-normal-ppo-as-printed")
    own = options.parse(["train", "my_module:Arm-v0"])
    assert isinstance(own, options.Train)
    assert own.run_dir() == Path("runs/my_module-Arm-v0-logit-normal-ppo")


@settings(deadline=None, max_examples=50)
@given(st.lists(st.integers(0, 30), min_size=1, unique=True).map(tuple))
def test_seeds_read_as_they_are_written(seeds: tuple[int, ...]) -> None:
    assert options.parse_seeds(options.format_seeds(seeds)) == seeds


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("train --policy normal", "'clipped-gaussian', 'beta'"),
        ("train --algo sac", "'policy-gradient'"),
        ("train --algorithm.clip-range -1", "clip_range must be positive"),
        ("train --algorithm.clip-rnge 0.1", "--algorithm.clip-range"),
        ("train --algorithm.minibatch-size 100", "= 20 × 100 + 48; 64 would"),
        ("train --seeds ten", "a number of seeds (10), some of them (0,7)"),
        ("train --seeds 1,1", "seeds must be different"),
        ("train --seeds 0", "'0' names no seeds"),
        ("train --seeds 5-3", "'5-3' names no seeds"),
        ("train --seeds 99999999999", "asks for 99999999999 seeds; one run holds at most 10000"),
        ("train --seeds ,", "',' names no seeds"),
        (f"train --seeds {','.join(map(str, range(10_001)))}", "asks for 10001 seeds; one run holds"),
        (
            "train --policy beta --policy.limits.log-std-max -3",
            "log-std-max limits nothing of beta: leave it out",
        ),
        ("train --policy gaussian --policy.limits.concentration-max=9", "limits nothing of gaussian"),
        ("train --policy.limits.log-std-max inf", "must lie within ±88"),
        ("train --network.policy-head-gain nan", "policy_head_gain must be a finite number"),
        ("train --policy beta --policy.no-state-dependent-std", "state_dependent_std=True"),
        ("train HalfCheeta-v5", "did you mean HalfCheetah-v5?"),
        ("train HalfCheetah", "HalfCheetah names no version: ask for HalfCheetah-v5"),
        ("train Tennis-v0", "The tasks are Hopper-v5, Walker2d-v5"),
        (
            "train CartPole-v1",
            "actions must be points of a bounded, one-dimensional Box, got Discrete(2): wrap",
        ),
        ("train --algorithm.max-kl 0.02", "--algorithm.max-kl is no option of ppo: add --algo trpo"),
        ("train --algo trpo --algorithm.clip-range=0.1", "is no option of trpo: add --algo ppo"),
        ("train --algorithm.max-lk 0.02", "Unrecognized options: --algorithm.max-lk"),
        ("walk", "train, watch, bench"),
    ],
)
def test_a_wrong_command_line_is_told_the_right_one(
    words: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "300")
    monkeypatch.chdir(tmp_path)
    code, out, err = run(*words.split())
    assert code == 2
    assert message in err
    assert out == ""
    assert not list(tmp_path.iterdir())  # a mistyped command leaves nothing behind


@pytest.mark.parametrize("words", ["--version", "doctor", "train --help"])
def test_output_that_has_no_room_is_told_in_a_line(words: str) -> None:
    with open("/dev/full", "w") as full:
        command = [sys.executable, "-m", "inbounds", *words.split()]
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr == "inbounds: the disk is full (where the output goes): make room, and run it again\n"


@pytest.mark.parametrize(
    ("words", "worker"),
    [
        ("run standard-swimmer-ppo-beta", "run_study"),
        ("evaluate standard-swimmer-ppo-beta", "evaluate_cells"),
        ("ledger centres", "judge"),
        ("verify standard-swimmer-ppo-beta", "verify"),
    ],
)
def test_only_a_wrong_command_line_is_called_one(
    words: str, worker: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An array of the wrong shape, hours into a study, needs its traceback."""

    def add(*_args: object, **_more: object) -> None:
        np.zeros(2) + np.zeros(3)

    monkeypatch.setattr(studying, worker, add)
    where = ("--results", tmp_path, "--work", tmp_path)
    with pytest.raises(ValueError, match="could not be broadcast"):
        run("study", *words.split(), *where)
    wrong = ("--rerun", "nonsense") if words.startswith("verify") else ("nonsense",)
    code, out, err = run("study", words.split()[0], *wrong, *where)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert err.startswith(f"inbounds study: no {'claim' if worker == 'judge' else 'cell matches'} nonsense")


@pytest.mark.parametrize("words", [["study", "dial"], ["study", "dial", "run", "--help"]], ids=" ".join)
def test_the_dial_has_examples_of_its_own(words: list[str]) -> None:
    _, examples = succeeds(words).split("\nexamples:\n")
    assert all(line.startswith("  inbounds study dial ") for line in examples.splitlines())
    assert examples not in succeeds(["study", "--help"])
    assert examples not in succeeds(["--help"])


def test_the_dial_says_what_to_do_about_its_folders(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    where = ("--results", str(tmp_path / "file" / "r"), "--work", str(tmp_path / "file" / "w"))
    code, out, err = run("study", "dial", "run", *where)
    assert (code, out, err.count("\n")) == (1, "", 1)
    assert err.startswith("inbounds study dial: ")
    assert err.endswith("What was finished is kept: choose other folders (--results, --work)\n")


@pytest.mark.parametrize(("word", "number"), [("run", 2), ("status", 1), ("verify", 1), ("ledger", 6)])
def test_a_word_of_the_study_has_its_own_examples_or_the_study_s(word: str, number: int) -> None:
    _, examples = succeeds(["study", word, "--help"]).split("\nexamples:\n")
    lines = examples.splitlines()
    assert len(lines) == number
    assert all(line.startswith(f"  inbounds study {word}") == (number < 6) for line in lines)


def test_the_version() -> None:
    assert run("--version") == (0, f"inbounds {inbounds.__version__}\n", "")
    assert "inbounds --version" in " ".join(run("--help")[1].split())


def test_as_a_module_in_a_process_of_its_own() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "inbounds", "watch", "nowhere"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert done.stderr == (
        "inbounds: there is no trained run in nowhere: train one first (inbounds train --help)\n"
    )


def test_bench_runs_the_script_of_the_source_tree(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("inbounds.cli.benchmark.find_root", lambda: tmp_path)
    (tmp_path / "benchmarks").mkdir()
    script = "import os, sys; print(sys.argv[1:], os.listdir()); sys.exit(3)"
    (tmp_path / "benchmarks" / "run.py").write_text(script)
    assert run("bench", "--quick", "--help")[0] == 3
    assert capfd.readouterr().out == "['--quick', '--help'] ['benchmarks']\n"


def test_bench_without_the_source_tree(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("inbounds.cli.benchmark.find_root", lambda: None)
    code, _, err = run("bench")
    assert code == 1
    assert "clone the project, and run `make bench`" in err
