"""Environments of the user's own: found where they are, imported on their owner's word, and heard when they raise."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from inbounds.cli import main
from inbounds.learning.storage.run_store import load_checkpoint
from tests.cli.small import SMALL

MODULE = '''
import os
import sys

import gymnasium
import numpy as np
from gymnasium.envs.mujoco.hopper_v5 import HopperEnv

print("IMPORTED")


class Target(gymnasium.Env):
    """One step from the target, or one of the ways not to get there."""

    observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (1,), np.float32)
    action_space = gymnasium.spaces.Box(-1.0, 1.0, (1,), np.float32)

    def __init__(self, fault=""):
        self.fault, self.steps = fault, 0

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        if self.fault == "reset":
            raise ValueError("the arm is not homed")
        if self.fault == "away":
            os.makedirs("away", exist_ok=True)
            os.chdir("away")
        return np.zeros(1, np.float32), {}

    def step(self, action):
        self.steps += 1
        if self.fault == "step":
            raise ValueError("the arm is stuck")
        if self.fault == "exit":
            sys.exit(0 if self.steps == 1 else "no licence")
        if self.fault == "late" and self.steps == 300:  # in the third epoch
            sys.exit("no licence")
        if self.fault == "file":
            open("no/such/calibration")
        if self.fault == "pipe":
            raise BrokenPipeError("the simulator has gone")
        broken = self.fault == "nan" and self.steps == 128  # the last one of an epoch
        reward = -np.inf if self.fault == "infinite" and self.steps == 20 else -abs(float(action[0]))
        return np.full(1, np.nan if broken else 0.0, np.float32), reward, False, False, {}


for fault in ("", "reset", "away", "step", "exit", "late", "file", "pipe", "nan", "infinite"):
    gymnasium.register(f"Target{fault}-v0", Target, kwargs={"fault": fault}, max_episode_steps=50)
gymnasium.register("OwnHopper-v0", HopperEnv, max_episode_steps=50)
'''


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "my arms.py").write_text("")
    (tmp_path / "my_arm.py").write_text(MODULE)
    return tmp_path


def inbounds(*words: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    """As the installed command, which does not look into the working directory by itself (-P)."""
    root = Path(__file__).resolve().parents[2] / "src"
    environ = os.environ | {"PYTHONPATH": str(root), "COLUMNS": "300"}
    command = [sys.executable, "-P", "-m", "inbounds", *words]
    return subprocess.run(
        command, cwd=cwd, env=environ, capture_output=True, text=True, check=False, timeout=120
    )


def train(env: str, folder: Path, *more: str) -> subprocess.CompletedProcess[str]:
    return inbounds("train", f"my_arm:{env}", *SMALL, "--epochs", "2", "--out", "my run", *more, cwd=folder)


@pytest.mark.slow
def test_a_module_is_found_in_its_own_folder_and_its_run_is_watched_on_request_only(folder: Path) -> None:
    done = train("OwnHopper-v0", folder)
    assert (done.returncode, done.stderr) == (0, "")
    assert "film it: inbounds watch 'my run' --trust" in done.stdout

    words = ("watch", "my run", "--seconds", "0.1", "--width", "64", "--height", "48")
    refused = inbounds(*words, cwd=folder)
    assert refused.returncode == 1
    assert "IMPORTED" not in refused.stdout
    assert "Python imports the module my_arm" in refused.stderr
    assert "inbounds watch 'my run' --trust" in refused.stderr
    assert refused.stderr.count("\n") == 1

    watched = inbounds(*words, "--trust", cwd=folder)
    assert (watched.returncode, watched.stderr) == (0, "")
    assert "IMPORTED" in watched.stdout
    assert (folder / "my run" / "median-seed0.mp4").stat().st_size > 0

    (folder / "my_arm.py").unlink()
    lost = inbounds(*words, "--trust", cwd=folder)
    assert lost.returncode == 1
    assert "my_arm:OwnHopper-v0 cannot be made here: No module named 'my_arm'" in lost.stderr
    assert lost.stderr.count("\n") == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "said"),
    [
        ("reset", "ValueError: the arm is not homed"),
        ("step", "ValueError: the arm is stuck"),
        ("file", "FileNotFoundError: [Errno 2] No such file or directory: 'no/such/calibration'"),
        ("pipe", "BrokenPipeError: the simulator has gone"),
    ],
)
def test_what_an_environment_raises_is_told_with_its_place(fault: str, said: str, folder: Path) -> None:
    done = train(f"Target{fault}-v0", folder)
    assert done.returncode == 1
    assert said in done.stderr
    assert 'my_arm.py", line' in done.stderr


@pytest.mark.slow
def test_a_run_stays_where_it_was_asked_for(folder: Path) -> None:
    """Whatever directory the environment goes to, at its resets even."""
    done = train("Targetaway-v0", folder)
    assert (done.returncode, done.stderr) == (0, "")
    assert "my run has curves.parquet" in done.stdout
    assert len(load_checkpoint(folder / "my run")["records"]) == 2
    assert not list((folder / "away").rglob("checkpoint.pt"))


@pytest.mark.slow
def test_an_environment_that_ends_the_process_is_told_from_a_call_for_help(folder: Path) -> None:
    done = train("Targetexit-v0", folder)
    assert done.returncode == 1
    assert done.stderr == "inbounds: the environment ended the process: sys.exit(0)\n"
    assert "examples" not in done.stdout
    late = train("Targetlate-v0", folder, "--epochs", "4")
    assert late.returncode == 1
    assert late.stderr == "inbounds: the environment ended the process: sys.exit('no licence')\n"
    assert "stopped by an error. 'my run' keeps 2 epochs" in late.stdout


@pytest.mark.slow
def test_a_run_that_goes_on_tells_what_its_environment_cannot(folder: Path) -> None:
    told = (
        "going on with my run, 2 epochs done; my_arm:Target-v0 cannot save its state, so new episodes begin"
    )
    train("Target-v0", folder)
    assert "new episodes" not in train("Target-v0", folder).stdout  # there is nothing to do
    assert told in train("Target-v0", folder, "--epochs", "3").stdout


@pytest.mark.parametrize("env", [":", ":Env-v0", "my_arm:", "my_arm::Env-v0"])
def test_half_an_environment_is_refused(env: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["train", env, *SMALL]) == 2
    assert f"{env!r} is no environment: give an id, or module:id. The tasks are" in capsys.readouterr().err


@pytest.mark.parametrize("fault", ["nan", "infinite"])
def test_observations_and_rewards_that_are_no_numbers_are_no_matter_of_the_learning_rate(
    fault: str, folder: Path
) -> None:
    done = train(f"Target{fault}-v0", folder)
    assert done.returncode == 1
    assert done.stdout.count("warning: ") == 1
    assert "warning: seeds [0, 1] diverged in epoch" in done.stdout
    assert "What helps: mend the environment, which has returned an observation" in done.stderr
    assert "learning" not in done.stderr + done.stdout
    again = train(f"Target{fault}-v0", folder)  # whose process has not seen why
    assert "smaller --algorithm.learning-rate" in again.stderr
    assert "that is NaN, mend the environment" in again.stderr


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="pipes of POSIX")
def test_training_that_nobody_reads_says_that_it_stops_and_keeps_everything(tmp_path: Path) -> None:
    words = [
        "train",
        "Swimmer-v5",
        *SMALL,
        "--epochs",
        "100000",
        "--checkpoint-every",
        "100000",
        "--out",
        "run",
    ]
    root = Path(__file__).resolve().parents[2] / "src"
    with subprocess.Popen(
        [sys.executable, "-m", "inbounds", *words],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(root)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        assert process.stdout.readline().startswith("epoch 1/")
        process.stdout.close()  # as `| head -1` does
        err = process.stderr.read()
    kept = len(load_checkpoint(tmp_path / "run")["records"])
    assert process.returncode == 141
    assert err == (
        "inbounds: stopped, because nobody reads the output any more. "
        f"run keeps {kept} epochs; the same command goes on from there\n"
    )


@pytest.mark.skipif(sys.platform == "win32", reason="pipes of POSIX")
@pytest.mark.parametrize(
    "words", [["--help"], ["--version"], ["study", "status", "--each"], ["study", "ledger"]]
)
def test_output_that_nobody_reads_ends_in_141(words: list[str]) -> None:
    root = Path(__file__).resolve().parents[2]
    reader, writer = os.pipe()
    os.close(reader)  # nobody, from the beginning
    with os.fdopen(writer, "w") as out:
        done = subprocess.run(
            [sys.executable, "-m", "inbounds", *words],
            cwd=root,
            env=os.environ | {"PYTHONPATH": str(root / "src")},
            stdout=out,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert (done.returncode, done.stderr) == (141, "")
