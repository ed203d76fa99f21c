import contextlib
import dataclasses
import errno
import io
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
import torch
from rich.console import Console

from inbounds.cli import main, options
from inbounds.cli.errors import CommandError
from inbounds.cli.progress import TrainingProgress
from inbounds.cli.tensorboard import TensorBoardWriter
from inbounds.cli.training import step_sizes
from inbounds.learning import Trainer
from inbounds.learning.config import ALGORITHMS
from inbounds.learning.storage import checkpoint
from inbounds.learning.storage.run_store import (
    CHECKPOINT_FILE,
    CURVES_FILE,
    POLICIES_FILE,
    load_checkpoint,
    load_policies,
    read_curves,
)
from inbounds.learning.storage.whole_files import LOCK_FILE, is_disk_full
from tests.cli.small import contents, run, same_rows, small, succeeds

FILES = {"checkpoint.pt", "curves.parquet", "policies.safetensors"}

HOLD = """
import sys
from pathlib import Path
from inbounds.learning.storage.whole_files import held
with held(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


def test_a_run_leaves_curves_policies_and_a_checkpoint(tmp_path: Path) -> None:
    out = succeeds(small(tmp_path / "run"))
    assert contents(tmp_path / "run").keys() == FILES
    curves = read_curves(tmp_path / "run")
    assert curves["epoch"].to_pylist() == [0, 0, 1, 1, 2, 2]
    assert curves["seed"].to_pylist() == [0, 1] * 3
    assert f"film it: inbounds watch {tmp_path / 'run'}" in out


# ---- progress


def test_plain_lines_where_there_is_no_terminal(tmp_path: Path) -> None:
    out = succeeds(small(tmp_path / "run"))
    last = next(line for line in out.splitlines() if line.startswith("epoch 3/3"))
    curves = read_curves(tmp_path / "run")
    returns, kl = curves["return_mean"].to_numpy()[-2:], curves["kl"].to_numpy()[-2:]
    assert f"return {returns.mean():.1f} ± {returns.std(ddof=1):.1f}  KL {kl.mean():#.2g}  saturation" in last
    assert "steps/s  0:00 left" in last
    assert "\x1b" not in out
    assert "\r" not in out


@pytest.mark.parametrize("every", ["1", "100"])
def test_what_is_kept_is_told_when_nobody_can_be_told(every: str, tmp_path: Path) -> None:
    """A full disk below the output is none below the run, which keeps what it has in any case."""
    with open("/dev/full", "w") as full:
        command = [sys.executable, "-m", "inbounds", *small(tmp_path / "run", 3), "--checkpoint-every", every]
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 1
    assert "stopped, because the output's disk is full" in done.stderr
    assert "keeps 1 epoch; the same command goes on from there" in done.stderr


@pytest.mark.parametrize("encoding", ["ascii", "latin-1"])
def test_a_terminal_without_our_letters_ends_no_run(
    encoding: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written = {name: io.BytesIO() for name in ("stdout", "stderr")}
    for name, to in written.items():
        monkeypatch.setattr(sys, name, io.TextIOWrapper(to, encoding, write_through=True))
    code = main(small(tmp_path / "run", 2))
    assert (code, written["stderr"].getvalue()) == (0, b"")
    assert b"done: 2 epochs" in written["stdout"].getvalue()


def test_without_an_output_it_trains(tmp_path: Path) -> None:
    words = " ".join(small(tmp_path / "run", 2))
    done = subprocess.run(
        ["sh", "-c", f"{sys.executable} -m inbounds {words} >&-"], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert len(load_checkpoint(tmp_path / "run")["records"]) == 2


def test_lines_on_a_terminal_that_cannot_write_over_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "dumb")
    assert not TrainingProgress(3, Console(force_terminal=True)).moves


def test_a_bar_on_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm")
    console = Console(force_terminal=True, width=150, record=True, file=open(os.devnull, "w"))  # noqa: SIM115
    command = small(Path("unused"))
    trainer = Trainer(options.parse(command).train_config())  # type: ignore[union-attr]
    with TrainingProgress(3, console) as progress:
        for _ in range(3):
            progress(trainer, trainer.epoch())
        progress.say_stopping()
    text = console.export_text()
    console.file.close()
    assert "epoch 3/3  return" in text
    assert "stopping after this epoch; again: at once" in text
    assert "━━━" in text


class Run:
    """All that progress looks at."""

    records: list[dict]
    config = SimpleNamespace(seeds=(0, 1, 2), algorithm=SimpleNamespace(horizon=4000))


def record(*returns: float, diverged: tuple[bool, ...] = (False,) * 3) -> dict:
    numbers = {name: np.array([0.25, 0.25, np.nan]) for name in ("kl", "saturation")}
    return {"return_mean": np.array(returns), "diverged": np.array(diverged), **numbers}


def test_the_return_of_a_seed_is_the_last_one_known() -> None:
    console = Console(width=200, file=open(os.devnull, "w"), record=True)  # noqa: SIM115
    Run.records = [record(1.0, np.nan, 100.0), record(np.nan, 3.0, np.nan, diverged=(False, False, True))]
    with TrainingProgress(2, console) as progress:
        progress(Run, Run.records[-1])  # as a resumed run: the first epoch was never shown
    console.file.close()
    text = console.export_text()
    assert "return 2.0 ± 1.4  KL 0.25  saturation 25.0 %" in text
    assert "1 of 3 seeds diverged" in text


@pytest.mark.parametrize("algo", ALGORITHMS)
def test_the_remedy_of_divergence_is_an_option_of_the_algorithm(algo: str, tmp_path: Path) -> None:
    chosen = [] if algo == "ppo" else ["--algo", algo]
    sizes = step_sizes(ALGORITHMS[algo][0])
    assert sizes[-1] == "--algorithm.learning-rate"
    for option in sizes:
        options.parse(["train", "Hopper-v5", *chosen, option, "0.001"])
    code, _, err = run(*small(tmp_path / "run", 2, "Hopper-v5", *chosen), "--algorithm.learning-rate", "1e30")
    assert code == 1
    assert f"train with a smaller {' or '.join(sizes)} in another --out" in err


def test_an_algorithm_of_tomorrow_has_its_remedy_of_divergence() -> None:
    fields = [("gamma", float), ("learning_rate", float), ("max_kl", float)]
    assert step_sizes(dataclasses.make_dataclass("Config", fields)) == [
        "--algorithm.max-kl",
        "--algorithm.learning-rate",
    ]


def test_speed_and_time_left_are_those_of_the_epochs_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    """A run that goes on after its tenth epoch: one epoch of 30 s, one of 50 s, and 98 more to come."""
    clock = SimpleNamespace(perf_counter=iter([1000.0, 1030.0, 1080.0]).__next__)
    monkeypatch.setattr("inbounds.cli.progress.time", clock)
    console = Console(width=200, file=open(os.devnull, "w"), record=True)  # noqa: SIM115
    Run.records = 10 * [record(1.0, 2.0, 3.0)]
    with TrainingProgress(110, console) as progress:
        for _ in range(2):
            Run.records = [*Run.records, record(1.0, 2.0, 3.0)]
            progress(Run, Run.records[-1])
    console.file.close()
    (first, *_, speed, left), (second, *_, mean_speed, less) = (
        line.split("  ") for line in console.export_text().splitlines()
    )
    assert (first, speed, left) == (
        "epoch 11/110",
        "400 steps/s",
        "49:30 left",
    )  # 3 · 4000 in 30 s; 99 · 30 s
    assert (second, mean_speed, less) == ("epoch 12/110", "300 steps/s", "1:05:20 left")  # 80 s; 98 · 40 s


def test_when_all_seeds_diverge(tmp_path: Path) -> None:
    code, out, err = run(*small(tmp_path / "run", 5), "--algorithm.learning-rate", "1e30")
    assert code == 1
    assert "warning: seeds [0, 1] diverged in epoch 0" in out
    assert "all seeds diverged, the last in epoch 0" in err
    assert "smaller --algorithm.learning-rate" in err
    assert read_curves(tmp_path / "run")["diverged"].to_pylist() == [True, True]
    code, _, err = run(*small(tmp_path / "run", 5), "--algorithm.learning-rate", "1e30")
    assert code == 1
    assert "all seeds diverged" in err
    code, _, err = run("watch", tmp_path / "run")
    assert code == 1
    assert "seed 0 diverged in training: all seeds did: train anew" in err


# ---- interruption


HEARING = """
import signal, sys
from inbounds.cli import main
signal.signal(signal.SIGINT, signal.default_int_handler)  # which a process in the background ignores
sys.exit(main())
"""


@contextlib.contextmanager
def handled(number: signal.Signals, by: Any) -> Iterator[None]:
    """A signal by a handler, whatever this process was started with."""
    before = signal.signal(number, by)
    try:
        yield
    finally:
        signal.signal(number, before)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_job_s_end_and_a_closed_terminal_stop_a_run_after_its_epoch(
    number: signal.Signals, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tell = TrainingProgress.__call__

    def signalled(self: TrainingProgress, trainer: Trainer, record: dict) -> None:
        tell(self, trainer, record)
        if len(trainer.records) == 2:
            signal.raise_signal(number)

    monkeypatch.setattr(TrainingProgress, "__call__", signalled)
    with handled(number, signal.default_int_handler):  # a signal that is not taken is heard all the same
        code, _, err = run(*small(tmp_path / "run", 10, "Hopper-v5", "--checkpoint-every", "100000"))
        assert signal.getsignal(number) is signal.default_int_handler
    assert code == 128 + number
    assert f"stopped. {tmp_path / 'run'} keeps 2 epochs; the same command goes on" in err
    assert len(load_checkpoint(tmp_path / "run")["records"]) == 2
    assert len(read_curves(tmp_path / "run")) == 2 * 2


@pytest.mark.parametrize("number", [signal.SIGKILL, pytest.param(signal.SIGINT, marks=pytest.mark.slow)])
def test_an_interrupted_run_goes_on_as_if_nothing_had_happened(
    number: signal.Signals, tmp_path: Path
) -> None:
    """Bit for bit: the same rows (wall time apart) and the same policies as the run that was not interrupted."""
    rarely = () if number == signal.SIGKILL else ("--checkpoint-every", "100000")  # then stopping must save
    words = small(tmp_path / "broken", 100_000, "Hopper-v5", *rarely)
    command = [sys.executable, "-c", HEARING, *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        assert process.stdout.readline().startswith("epoch 1/")
        if number == signal.SIGKILL:
            wait_for(tmp_path / "broken" / "curves.parquet")
        time.sleep(0.1)  # anywhere in an epoch
        process.send_signal(number)
        err = process.stderr.read()
    kept = len(load_checkpoint(tmp_path / "broken")["records"])
    if number == signal.SIGKILL:
        assert process.returncode == -number
    else:
        assert process.returncode == 128 + number
        assert f"stopped. {tmp_path / 'broken'} keeps {kept} epochs; the same command goes on" in err
        assert "Traceback" not in err
        assert len(read_curves(tmp_path / "broken")) == 2 * kept
    assert f"{kept} epochs done" in succeeds(small(tmp_path / "broken", kept + 3))
    succeeds(small(tmp_path / "whole", kept + 3))
    assert same_rows(*(read_curves(tmp_path / name) for name in ("broken", "whole")))
    policies = contents(tmp_path / "broken")["policies.safetensors"]
    assert policies == contents(tmp_path / "whole")["policies.safetensors"]


def wait_for(path: Path) -> None:
    for _ in range(600):
        if path.exists():
            return
        time.sleep(0.05)
    raise AssertionError(f"{path} never came")


def test_ctrl_c_twice_ends_at_once_and_says_what_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    step, steps = checkpoint.save, []

    def impatient(path: Path, state: dict) -> None:
        steps.append(path)
        if len(steps) == 2:
            os.kill(os.getpid(), signal.SIGINT)
            os.kill(os.getpid(), signal.SIGINT)
        step(path, state)

    monkeypatch.setattr(checkpoint, "save", impatient)
    # As at a terminal: a shell may ignore Ctrl-C for what it starts in the background.
    with handled(signal.SIGINT, signal.default_int_handler):
        code, _, err = run(*small(tmp_path / "run", 10))
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert code == 130
    assert f"stopped in mid-epoch. {tmp_path / 'run'} keeps 2 epochs" in err
    assert len(load_checkpoint(tmp_path / "run")["records"]) == 2


def test_under_nohup_a_closed_terminal_stops_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    step = checkpoint.save

    def hung_up(path: Path, state: dict) -> None:
        signal.raise_signal(signal.SIGHUP)
        step(path, state)

    monkeypatch.setattr(checkpoint, "save", hung_up)
    with handled(signal.SIGHUP, signal.SIG_IGN):
        succeeds(small(tmp_path / "run", 3))
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    assert len(load_checkpoint(tmp_path / "run")["records"]) == 3


def test_a_finished_run_is_left_as_it_is_and_can_be_prolonged(tmp_path: Path) -> None:
    succeeds(small(tmp_path / "run", 2))
    before = contents(tmp_path / "run")
    assert "there was nothing to do: 2 epochs are done" in succeeds(small(tmp_path / "run", 2))
    assert contents(tmp_path / "run") == before
    assert "new episodes" not in succeeds(small(tmp_path / "run", 4))  # our robots go on where they stood
    succeeds(small(tmp_path / "whole", 4))
    assert same_rows(read_curves(tmp_path / "run"), read_curves(tmp_path / "whole"))
    prolonged = contents(tmp_path / "run")
    assert "there was nothing to do: 4 epochs are done" in succeeds(small(tmp_path / "run", 2))
    assert contents(tmp_path / "run") == prolonged


# ---- what could be lost


@pytest.mark.parametrize(
    ("more", "difference"),
    [
        (["--algorithm.clip-range", "0.1"], "(--algorithm.clip-range 0.2 there, 0.1 here)"),
        (["--policy", "beta"], "(--policy logit-normal there, beta here)"),
        (["--algo", "trpo"], "(--algo ppo there, trpo here)"),
        (["--seeds", "4-6"], "(--seeds 2 there, 4-6 here)"),
        (["--network.hidden-sizes", "8", "4"], "(--network.hidden-sizes 8 there, 8 4 here)"),
    ],
)
def test_another_configuration_is_refused(more: list[str], difference: str, tmp_path: Path) -> None:
    succeeds(small(tmp_path / "run", 1))
    before = contents(tmp_path / "run")
    code, _, err = run(*small(tmp_path / "run", 2), *more)
    assert code == 2
    assert difference in err
    assert "choose another --out" in err
    assert contents(tmp_path / "run") == before


def test_a_run_without_its_checkpoint_is_not_overwritten(tmp_path: Path) -> None:
    succeeds(small(tmp_path / "run", 1))
    (tmp_path / "run" / "checkpoint.pt").unlink()
    before = contents(tmp_path / "run")
    code, _, err = run(*small(tmp_path / "run", 2))
    assert code == 1
    assert "without its checkpoint, which a new one would overwrite" in err
    assert contents(tmp_path / "run") == before


@pytest.mark.parametrize("harm", ["cut short", "empty", "flipped", "text"])
def test_a_damaged_checkpoint_is_named_and_nothing_is_lost(harm: str, tmp_path: Path) -> None:
    succeeds(small(tmp_path / "run", 2))
    path = tmp_path / "run" / "checkpoint.pt"
    damage(path, harm)
    before = contents(tmp_path / "run")
    code, _, err = run(*small(tmp_path / "run", 4))
    assert code == 1
    assert err.count("\n") == 1
    assert f"{path} is damaged, cut short or of another origin" in err
    assert f"move {path.parent} out of the way and train again" in err
    assert contents(tmp_path / "run") == before


def test_a_folder_in_the_checkpoint_s_place_is_told(tmp_path: Path) -> None:
    (tmp_path / "run" / "checkpoint.pt").mkdir(parents=True)
    code, _, err = run(*small(tmp_path / "run"))
    assert code == 1
    assert err == (
        f"inbounds: {tmp_path / 'run' / 'checkpoint.pt'} is no file: choose another --out, or move it out of the way\n"
    )


@pytest.mark.parametrize("harm", ["cut short", "empty", "flipped", "text"])
@pytest.mark.parametrize("name", ["curves.parquet", "policies.safetensors"])
def test_damaged_curves_and_policies_are_written_anew(name: str, harm: str, tmp_path: Path) -> None:
    succeeds(small(tmp_path / "run", 2))
    path = tmp_path / "run" / name
    whole = path.read_bytes()
    damage(path, harm)
    read = read_curves if name == "curves.parquet" else load_policies
    with pytest.raises(ValueError, match=r"repeat the `inbounds train` command of this run"):
        read(tmp_path / "run")
    if read is load_policies:
        code, _, err = run("watch", tmp_path / "run")
        assert (code, err.count("\n")) == (1, 1)
        assert f"{path} is damaged" in err
    succeeds(small(tmp_path / "run", 2))
    assert path.read_bytes() == whole


def damage(path: Path, harm: str) -> None:
    data = path.read_bytes()
    if harm == "flipped":  # one bit of the numbers themselves
        where = len(data) // 2
        if path.suffix == ".safetensors":
            where = 8 + int.from_bytes(data[:8], "little") + 100  # behind the header
        if path.suffix == ".parquet":
            column = pq.ParquetFile(path).metadata.row_group(0).column(6)
            where = column.data_page_offset + column.total_compressed_size - 1
        path.write_bytes(data[:where] + bytes([data[where] ^ 64]) + data[where + 1 :])
    else:
        harms = {"cut short": data[: len(data) // 2], "empty": b"", "text": b"not what you think\n" * 100}
        path.write_bytes(harms[harm])


def test_a_full_disk_keeps_the_last_checkpoint(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calls, sync = [], os.fsync

    def full(descriptor: int) -> None:
        calls.append(descriptor)
        if len(calls) == 4:  # checkpoint, curves and policies of epoch 2; then the checkpoint of epoch 4
            raise OSError(errno.ENOSPC, "No space left on device")
        sync(descriptor)

    monkeypatch.setattr(os, "fsync", full)
    code, _, err = run(*small(tmp_path / "run", 6))
    assert code == 1
    assert err.count("\n") == 1
    assert "the disk is full" in err
    assert (
        f"{tmp_path / 'run'} keeps 2 epochs; the same command goes on from there. Make room first (df -h"
        in err
    )
    succeeds(small(tmp_path / "run", 6))
    succeeds(small(tmp_path / "whole", 6))
    assert same_rows(read_curves(tmp_path / "run"), read_curves(tmp_path / "whole"))


def test_a_disk_that_is_full_from_the_start_names_a_folder_that_exists(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(descriptor: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    code, _, err = run(*small(tmp_path / "my runs" / "run", 6))
    assert code == 1
    assert f"before the first checkpoint: nothing is kept. Make room first (df -h {tmp_path})" in err
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device that Linux has")
def test_a_full_disk_is_recognised_in_what_torch_makes_of_it() -> None:
    disk = open("/dev/full", "wb")  # noqa: SIM115 (closed below)
    with pytest.raises(RuntimeError, match="unexpected pos") as caught:
        torch.save({"weights": torch.zeros(100_000)}, disk)
    with pytest.raises(OSError, match="No space left"):
        disk.close()
    assert is_disk_full(caught.value)
    assert not is_disk_full(RuntimeError("of another kind"))


def test_a_name_that_is_too_long(tmp_path: Path) -> None:
    code, _, err = run(*small(tmp_path / (300 * "a")))
    assert code == 2
    assert "too long for the disk" in err
    assert err.count("\n") == 1


def test_where_no_run_directory_can_be(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    code, _, err = run(*small(tmp_path / "file"))
    assert code == 1
    assert "cannot be a run directory (File exists): choose another --out" in err


def test_two_processes_do_not_train_in_one_directory(tmp_path: Path) -> None:
    holder = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(tmp_path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    with holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "held\n"
        code, _, err = run(*small(tmp_path))
        assert code == 1
        assert "another process trains" in err
        assert contents(tmp_path).keys() == {LOCK_FILE}
        holder.kill()
    succeeds(small(tmp_path, 1))  # the dead hold nothing
    assert contents(tmp_path).keys() == FILES


# ---- TensorBoard


def test_tensorboard_shows_the_curves_once(tmp_path: Path) -> None:
    accumulator = pytest.importorskip("tensorboard.backend.event_processing.event_accumulator")
    succeeds(small(tmp_path / "run", 2, "Hopper-v5", "--tensorboard"))
    succeeds(small(tmp_path / "run", 4, "Hopper-v5", "--tensorboard"))
    curves = read_curves(tmp_path / "run")
    for seed in (0, 1):
        of_seed = curves.filter(np.array(curves["seed"]) == seed)
        events = accumulator.EventAccumulator(str(tmp_path / "run" / "tensorboard" / f"seed-{seed}")).Reload()
        names = events.Tags()["scalars"]
        assert {*names} == {*curves.column_names} - {"epoch", "env_steps", "seed"}
        for name in names:
            scalars = events.Scalars(name)
            assert (
                [event.step for event in scalars] == of_seed["env_steps"].to_pylist() == [128, 256, 384, 512]
            )
            expected = of_seed[name].to_numpy(zero_copy_only=False).astype(float)
            np.testing.assert_allclose([event.value for event in scalars], expected, rtol=1e-6, err_msg=name)


def test_tensorboard_without_a_place_for_its_files(tmp_path: Path) -> None:
    pytest.importorskip("tensorboard")
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "tensorboard").touch()
    code, _, err = run(*small(tmp_path / "run", 1, "Hopper-v5", "--tensorboard"))
    assert code == 1
    assert "cannot hold TensorBoard's files" in err
    assert "choose another --out" in err


class Writer:
    """Of TensorBoard's events, on a disk that is full from some moment on."""

    full = OSError(errno.ENOSPC, "No space left on device")
    at_once = False

    def __init__(self, *_: object, **__: object) -> None:
        if self.at_once:
            raise self.full

    def close(self) -> None:
        raise self.full


def test_a_full_disk_stops_tensorboard_and_not_what_there_is_to_say(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("tensorboard")
    monkeypatch.setattr("torch.utils.tensorboard.SummaryWriter", Writer)
    with pytest.raises(CommandError, match="keeps 3 epochs"), TensorBoardWriter(tmp_path, (0,)):
        raise CommandError("keeps 3 epochs")
    with pytest.raises(OSError, match="No space left"), TensorBoardWriter(tmp_path, (0,)):
        pass
    monkeypatch.setattr(Writer, "at_once", True)
    with pytest.raises(CommandError, match=r"the disk is full.*Make room"):
        TensorBoardWriter(tmp_path, (0,))


@pytest.mark.parametrize(
    "make",
    [
        lambda: torch.empty(2**60),
        lambda: np.empty(2**59),
        lambda: np.empty((2**40, 2**40)),
        lambda: np.random.default_rng(0).standard_normal((10**20, 1)),
    ],
    ids=["torch", "numpy", "numpy, beyond its index", "numpy, beyond 64 bits"],
)
def test_without_memory_for_it_a_run_ends_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, make: Any
) -> None:
    monkeypatch.setattr("inbounds.cli.training.train", lambda *_, **__: make())
    code, _, err = run(*small(tmp_path / "run", 1, "Hopper-v5"))
    assert (code, err.count("\n")) == (1, 1)
    assert err.startswith("inbounds: there is no memory for such a run: choose fewer --seeds")


def test_what_a_killed_process_left_half_written_goes(tmp_path: Path) -> None:
    left = [tmp_path / f".{name}.0123abcd.partial" for name in (CURVES_FILE, POLICIES_FILE, CHECKPOINT_FILE)]
    for each in left:
        each.touch()
    succeeds(small(tmp_path, 1))
    assert not any(each.exists() for each in left)


def test_tensorboard_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "tensorboard", None)
    monkeypatch.delitem(sys.modules, "torch.utils.tensorboard", raising=False)
    code, _, err = run(*small(tmp_path / "run", 1, "Hopper-v5", "--tensorboard"))
    assert code == 1
    assert "pip install '.[tensorboard]'" in err
    assert not (tmp_path / "run").exists()


def test_main_takes_the_command_line_of_the_process(monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    monkeypatch.setattr(sys, "argv", ["inbounds", "watch", "nowhere"])
    assert main() == 1
    assert "there is no trained run in nowhere" in capsys.readouterr().err
