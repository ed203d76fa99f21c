"""Compiled functions are read from disk: a process that finds nothing there computes the bits of one that does."""

import inspect
import json
import os
import pickle
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from numba.core import config as numba_config

from inbounds.learning.networks import compiling, kernels
from inbounds.learning.networks.compiled_acting import make_see
from inbounds.learning.networks.compiling import ReadFromDisk, kept_on_disk
from inbounds.learning.updates import compiled
from inbounds.learning.updates.compiled import make_ppo_passes

BITS = """
import hashlib, json, sys
import numpy as np, torch
torch.set_num_threads(1)
from inbounds.learning import Trainer, preset
import dataclasses

def bits(algo, family, dtype):
    config = preset("common", "HalfCheetah-v5", policy=family, algo=algo, seeds=(0,), epochs=2)
    config = dataclasses.replace(config, network=dataclasses.replace(config.network, dtype=dtype))
    numbers = {"horizon": 256, "minibatch_size": 64, "num_epochs": 2}
    algorithm = dataclasses.replace(config.algorithm, **numbers)
    run = Trainer(dataclasses.replace(config, algorithm=algorithm, engine="compiled"))
    run.epoch(), run.epoch()
    rows = [net.theta.numpy().tobytes() for net in run.networks.networks]
    return hashlib.sha256(b"".join(rows)).hexdigest()

print(json.dumps({":".join(pair): bits(*pair) for pair in json.loads(sys.argv[1])}))
"""
RUNS = [
    ("ppo", "logit-normal", "float32"),
    ("ppo", "gaussian", "float64"),
    ("ppo", "beta", "float64"),
    ("trpo", "logit-normal", "float32"),
]


def bits(runs: list[tuple[str, str, str]], cache: Path) -> dict[str, str]:
    """Digests of the weights after some runs of a process of their own."""
    command = [sys.executable, "-c", BITS, json.dumps(runs)]
    done = subprocess.run(
        command, env={**os.environ, "NUMBA_CACHE_DIR": str(cache)}, capture_output=True, text=True, check=True
    )
    return dict(json.loads(done.stdout))


@pytest.mark.slow
def test_what_has_just_been_compiled_has_the_bits_of_what_is_read_in_any_order(tmp_path: Path) -> None:
    fresh = bits(RUNS, tmp_path)
    assert len(set(fresh.values())) == len(RUNS)
    assert (
        len(list(tmp_path.rglob("*.nbi"))) == 6
    )  # three laws' passes, the values' pass, outputs, statistics
    for runs in (RUNS[::-1], RUNS[:1]):
        assert bits(runs, tmp_path).items() <= fresh.items()


def numbers(value: float = 3.0) -> tuple[Any, ...]:
    return np.array([[value]]), 1, np.zeros((1, 1)), np.zeros((1, 1)), np.zeros((1, 1))


@pytest.fixture
def nothing_on_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(numba_config, "CACHE_DIR", str(tmp_path))
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    return tmp_path


def test_this_process_compiles_nothing(nothing_on_disk: Path) -> None:
    see = ReadFromDisk(make_see)
    given = numbers()
    see(*given)
    assert given[2].tolist() == [[3.0]]
    stats = see._function.stats
    assert (sum(stats.cache_hits.values()), sum(stats.cache_misses.values())) == (1, 1)  # missed, then read
    assert [path.suffix for path in sorted(nothing_on_disk.rglob("kernels.see*"))] == [".nbc", ".nbi"]


def test_other_types_are_compiled_beside_the_first(nothing_on_disk: Path) -> None:
    see = ReadFromDisk(make_see)
    see(*numbers())
    single = *numbers()[:4], np.zeros((1, 1), np.float32)
    see(*single)
    assert single[2].tolist() == [[3.0]]
    assert len(see._function.signatures) == 2


def test_where_nothing_can_be_kept_a_temporary_folder_serves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(numba_config, "CACHE_LOCATOR_CLASSES", "UserProvidedCacheLocator")
    monkeypatch.setattr(numba_config, "CACHE_DIR", "")
    monkeypatch.setenv("NUMBA_CACHE_DIR", "")
    compiling._for_this_process.cache_clear()
    monkeypatch.setattr(compiling.tempfile, "tempdir", str(tmp_path))
    see = ReadFromDisk(make_see)
    given = numbers()
    see(*given)
    assert given[2].tolist() == [[3.0]]
    (folder,) = tmp_path.iterdir()
    assert see._function.stats.cache_path.startswith(str(folder))
    compiling._for_this_process().cleanup()
    compiling._for_this_process.cache_clear()


def test_a_failure_of_the_other_process_says_what_it_said(
    nothing_on_disk: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    see = ReadFromDisk(make_see)
    monkeypatch.setattr(compiling.sys, "executable", "/bin/false")
    with pytest.raises(
        ValueError, match=r"/bin/false could not compile make_see \(it said nothing\): try again"
    ):
        see(*numbers())


def test_another_folder_is_named(nothing_on_disk: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(nothing_on_disk / "elsewhere"))
    monkeypatch.setattr(compiling, "_TRIES", 1)
    with pytest.raises(ValueError, match=f"compiled, and is not in {nothing_on_disk}.*set NUMBA_CACHE_DIR"):
        ReadFromDisk(make_see)(*numbers())


@pytest.mark.parametrize("changed", [compiling, *compiling.ALWAYS_CALLED], ids=lambda module: module.__name__)
def test_what_is_kept_is_not_found_after_a_change_of_what_it_calls(
    changed: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = kept_on_disk(kernels.see, fast=()).py_func.__qualname__
    source = inspect.getsource
    monkeypatch.setattr(inspect, "getsource", lambda module: source(module) + "#" * (module is changed))
    assert kept_on_disk(kernels.see, fast=()).py_func.__qualname__ != before


@pytest.mark.parametrize("family", ["gaussian", "clipped_gaussian", "logit_normal", "beta"])
def test_each_module_that_is_called_is_in_the_name(family: str, monkeypatch: pytest.MonkeyPatch) -> None:
    module = f"inbounds.learning.families.{family}_kernel"
    named = {one.__name__ for one in compiling.ALWAYS_CALLED}

    def note(function: Any, *modules: ModuleType) -> Any:
        named.update(one.__name__ for one in modules)
        return kept_on_disk(function, *modules)

    monkeypatch.setattr(compiled, "kept_on_disk", note)
    called = {one.py_func.__module__ for one in compiling._kernels_below(make_ppo_passes(module).py_func)}
    assert module in called
    assert called <= named


def test_what_is_asked_of_the_other_process_can_be_pickled() -> None:
    see = ReadFromDisk(make_see)
    make, names = pickle.loads(pickle.dumps(see._recipe))
    assert (make, names) == (make_see, ())


def test_no_two_of_what_a_function_calls_have_one_name() -> None:
    """Linked by module and name they would be mixed up; a logit-normal's entropy calls a Normal's."""
    function = make_ppo_passes("inbounds.learning.families.logit_normal_kernel")
    called = [kernel.py_func for kernel in compiling._kernels_below(function.py_func)]
    assert len({(one.__module__, one.__qualname__) for one in called}) == len(called)
    expected = (
        "adam backward beyond clipped descend entropy_slope entropy_slope forward gather hold_free_scale "
    )
    expected += "normalize policy_slope rational_tanh score sum_of_squares surrogate_slope tanh value_slope"
    assert sorted(one.__name__ for one in called) == expected.split()
