"""`inbounds train --engine compiled`."""

import re
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from inbounds.learning import TrainConfig, load_policy
from inbounds.learning.training import prepare
from tests.cli.small import run, small, succeeds


def test_the_compiled_engine_says_how_long_compiling_took_and_stays_with_its_run(tmp_path: Path) -> None:
    said = succeeds(small(tmp_path / "run", 1, "Swimmer-v5", "--engine", "compiled"))
    first, second, *_ = said.splitlines()
    assert first == "compiling the update for this processor; the next run finds it on disk"
    assert re.fullmatch(r"compiled, or found on disk, in \d+\.\d s", second)
    assert load_policy(tmp_path / "run").config.engine == "compiled"
    code, _, err = run(*small(tmp_path / "run", 2, "Swimmer-v5"))
    assert code == 2
    assert "another configuration (--engine compiled there, autograd here)" in err
    assert "epoch 2/2" in succeeds(small(tmp_path / "run", 2, "Swimmer-v5", "--engine", "compiled"))


def test_compiling_is_no_part_of_speed_and_time_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    waited = [0.0]

    def an_hour(config: TrainConfig) -> float:
        waited[0] = 3600.0
        return prepare(config)

    clock = SimpleNamespace(perf_counter=lambda: time.perf_counter() + waited[0])
    monkeypatch.setattr("inbounds.cli.progress.time", clock)
    monkeypatch.setattr("inbounds.cli.training.prepare", an_hour)
    said = succeeds(small(tmp_path / "run", 2, "Swimmer-v5", "--engine", "compiled"))
    assert waited == [3600.0]
    speed, left = re.findall(r"epoch 1/2 .*  (\S+) steps/s  (\S+) left", said)[0]
    assert float(speed.replace(",", "")) > 5
    assert left.startswith("0:")  # of minutes


def test_the_compiled_engine_without_numba_names_the_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("inbounds.learning.updates.engine.NEEDS", ("a_compiler_that_nobody_has",))
    code, out, err = run(*small(tmp_path / "run", 1, "Swimmer-v5", "--engine", "compiled", "--tensorboard"))
    assert (code, out) == (2, "")
    assert "needs a_compiler_that_nobody_has, of the extra `fast`: pip install '.[fast]'" in err
    assert not (tmp_path / "run").exists()
