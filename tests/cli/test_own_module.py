"""Environments of the user's own: found where they are, imported on their owner's word, and heard when they raise."""

import os
import subprocess
import sys
import traceback
from collections.abc import Iterator
from pathlib import Path

import gymnasium
import pytest

from inbounds.cli import main
from inbounds.learning.storage.run_store import load_checkpoint
from tests.cli.small import SMALL, run

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
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Where the module is, and this process too: what it imports and registers there goes with the test."""
    (tmp_path / "my arms.py").write_text("")
    (tmp_path / "my_arm.py").write_text(MODULE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", sys.path.copy())
    yield tmp_path
    sys.modules.pop("my_arm", None)
    for name in [each for each in gymnasium.registry if each.startswith(("Target", "OwnHopper"))]:
        del gymnasium.registry[name]


def inbounds(*words: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    """As the installed command, which does not look into the working directory by itself (-P)."""
    root = Path(__file__).resolve().parents[2] / "src"
    environ = os.environ | {"PYTHONPATH": str(root), "COLUMNS": "300"}
    command = [sys.executable, "-P", "-m", "inbounds", *words]
    return subprocess.run(
        command, cwd=cwd, env=environ, capture_output=True, text=True, check=False, timeout=120
    )


def training(env: str, *more: str) -> list[str]:
    return ["train", f"my_arm:{env}", *SMALL, "--epochs", "2", "--out", "my run", *more]


@pytest.mark.slow
def test_a_module_is_found_in_its_own_folder_and_its_run_is_watched_on_request_only(folder: Path) -> None:
    done = inbounds(*training("OwnHopper-v0"), cwd=folder)
    assert (done.returncode, done.stderr) == (0, "")
    assert "film it: inbounds watch 'my run' --trust" in done.stdout

    words = ("watch", "my run", "--seconds", "0.1", "--width", "64", "--height", "48")
    code, out, err = run(*words)
    assert code == 1
    assert "IMPORTED" not in out
    assert "my_arm" not in sys.modules
    assert "Python imports the module my_arm" in err
    assert "inbounds watch 'my run' --trust" in err
    assert err.count("\n") == 1

    (folder / "assets").mkdir()  # where it looks for its files from now on
    (folder / "my_arm.py").write_text(f"{MODULE}\nos.chdir({str(folder / 'assets')!r})\n")
    watched = inbounds(*words, "--trust", cwd=folder)
    assert (watched.returncode, watched.stderr) == (0, "")
    assert "IMPORTED" in watched.stdout
    assert (folder / "my run" / "median-seed0.mp4").stat().st_size > 0

    (folder / "my_arm.py").unlink()
    code, _, err = run(*words, "--trust")
    assert code == 1
    assert "my_arm:OwnHopper-v0 cannot be made here: No module named 'my_arm'" in err
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("fault", "error", "said"),
    [
        ("reset", ValueError, "the arm is not homed"),
        ("step", ValueError, "the arm is stuck"),
        ("file", FileNotFoundError, r"No such file or directory: 'no/such/calibration'"),
    ],
)
@pytest.mark.usefixtures("folder")
def test_what_an_environment_raises_keeps_its_place(fault: str, error: type[Exception], said: str) -> None:
    with pytest.raises(error, match=said) as raised:
        run(*training(f"Target{fault}-v0"))
    assert Path(traceback.extract_tb(raised.tb)[-1].filename).name == "my_arm.py"


@pytest.mark.slow
def test_an_environments_broken_pipe_is_told_with_its_place(folder: Path) -> None:
    """And is not taken for output that nobody reads."""
    done = inbounds(*training("Targetpipe-v0"), cwd=folder)
    assert done.returncode == 1
    assert "BrokenPipeError: the simulator has gone" in done.stderr
    assert 'my_arm.py", line' in done.stderr


def test_a_run_stays_where_it_was_asked_for(folder: Path) -> None:
    """Whatever directory the environment goes to, at its resets even."""
    code, out, err = run(*training("Targetaway-v0"))
    assert (code, err) == (0, "")
    assert "my run has curves.parquet" in out
    assert len(load_checkpoint(folder / "my run")["records"]) == 2
    assert not list((folder / "away").rglob("checkpoint.pt"))


@pytest.mark.slow
def test_an_environment_that_ends_the_process_is_told_from_a_call_for_help(folder: Path) -> None:
    done = inbounds(*training("Targetexit-v0"), cwd=folder)
    assert done.returncode == 1
    assert done.stderr == "inbounds: the environment ended the process: sys.exit(0)\n"
    assert "examples" not in done.stdout
    code, out, err = run(*training("Targetlate-v0", "--epochs", "4"))
    assert code == 1
    assert err == "inbounds: the environment ended the process: sys.exit('no licence')\n"
    assert "stopped by an error. 'my run' keeps 2 epochs" in out


@pytest.mark.usefixtures("folder")
def test_a_run_that_goes_on_tells_what_its_environment_cannot() -> None:
    told = (
        "going on with my run, 2 epochs done; my_arm:Target-v0 cannot save its state, so new episodes begin"
    )
    assert run(*training("Target-v0"))[0] == 0
    assert "new episodes" not in run(*training("Target-v0"))[1]  # there is nothing to do
    assert told in run(*training("Target-v0", "--epochs", "3"))[1]


@pytest.mark.parametrize("env", [":", ":Env-v0", "my_arm:", "my_arm::Env-v0"])
def test_half_an_environment_is_refused(env: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["train", env, *SMALL]) == 2
    assert f"{env!r} is no environment: give an id, or module:id. The tasks are" in capsys.readouterr().err


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize("fault", ["nan", "infinite"])
def test_observations_and_rewards_that_are_no_numbers_are_no_matter_of_the_learning_rate(fault: str) -> None:
    code, out, err = run(*training(f"Target{fault}-v0"))
    assert code == 1
    assert out.count("warning: ") == 1
    assert "warning: seeds [0, 1] diverged in epoch" in out
    assert "What helps: mend the environment, which has returned an observation" in err
    assert "learning" not in err + out
    _, _, again = run(*training(f"Target{fault}-v0"))  # which has not seen why
    assert "smaller --algorithm.learning-rate" in again
    assert "that is NaN, mend the environment" in again


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


@pytest.mark.slow
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
