"""The trained greenhouses that the book shows: how they were trained, and what they earn on days kept for the table.

    python -m inbounds.book.own_task.greenhouse_runs         # trains all four families anew: some minutes on one core

`results/greenhouse/FAMILY.safetensors` has the final policies of ten seeds, `curves.parquet` a row per family, seed and
epoch of what training recorded, `returns.parquet` a row per family, seed, way to act and day of `TESTED`.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from inbounds.book.own_task.comparing import Actor, Floats, greedy, noisy, play
from inbounds.book.own_task.greenhouse import GreenhouseBatch
from inbounds.learning import FAMILIES, TrainConfig, TrainedPolicy, Trainer, load_policies, preset
from inbounds.learning.storage.run_store import save_policies
from inbounds.study.store import GREENHOUSE, ROOT, StudyFolder

__all__ = ["CHOSEN_BY", "FAMILIES", "TESTED", "plan", "policies", "read_curves", "read_returns"]

CHOSEN_BY = tuple(range(5000, 5040))
"""Days for choosing: the constant, the numbers of the thermostat, the settings of training."""
TESTED = tuple(range(6000, 6200))
"""Days for the table alone. No day of training has one of these seeds."""
WAYS = ("greedy", "noisy")
RECORDED = ("return_mean", "saturation", "kl", "clip_fraction", "explained_variance", "episodes", "sigma")
EPOCHS = 160
FOLDER = ROOT / "results" / GREENHOUSE


def plan(family: str, seeds: int | tuple[int, ...] = 10, epochs: int = EPOCHS) -> TrainConfig:
    """Return how a family is trained on the greenhouse.

    A rollout is ten days. γ = 0.97 looks eight hours ahead. Every family starts with half of the half range as its
    executed noise. Adam's step size, and the number of epochs, were chosen with the seeds 100 to 103 on `CHOSEN_BY`.

    Args:
        family: the policy's.
        seeds: how many, or which.
        epochs: rollouts.

    Example:
        >>> plan("beta", seeds=2).algorithm.horizon
        960
    """
    config = preset("common", "greenhouse", policy=family, seeds=seeds, epochs=epochs)
    return dataclasses.replace(
        config,
        engine="compiled",
        network=dataclasses.replace(config.network, hidden_sizes=(32, 32)),
        policy=dataclasses.replace(config.policy, initial_std=0.5),
        algorithm=dataclasses.replace(config.algorithm, horizon=960, gamma=0.97, learning_rate=1e-3),
    )


def note_sigma(trainer: Trainer, record: dict[str, Any]) -> None:
    """Add the mean σ of the latents of the rollout to a record `[S]`; of a Beta, which has none, NaN."""
    rollout = trainer.rollout
    scale = getattr(getattr(rollout, "parameters", None), "log_scale", None)
    seeds = len(trainer.config.seeds)
    record["sigma"] = np.full(seeds, np.nan) if scale is None else scale.exp().mean((1, 2)).numpy()


def actors(policy: TrainedPolicy) -> dict[str, Actor]:
    """Return the ways in which a trained policy acts."""
    return {"greedy": greedy(policy), "noisy": noisy(policy, seed=policy.seed)}


def policies(family: str, folder: Path = FOLDER) -> list[TrainedPolicy]:
    """Return the shipped policies of a family, a seed each."""
    return load_policies(folder / f"{family}.safetensors")


def read_returns(folder: Path = FOLDER) -> dict[tuple[str, str], Floats]:
    """Return the shipped returns `[S, N]` by family and way to act, on the days of `TESTED`."""
    table = pq.read_table(folder / "returns.parquet")
    return {
        (family, way): _square(rows, "seed", "day", "return")
        for family in FAMILIES
        for way in WAYS
        if (rows := _rows(table, family=family, way=way)).num_rows
    }


def read_curves(folder: Path = FOLDER) -> dict[str, dict[str, Floats]]:
    """Return what training recorded, `[S, E]` by family and by name of the record."""
    table = pq.read_table(folder / "curves.parquet")
    return {
        family: {name: _square(_rows(table, family=family), "seed", "epoch", name) for name in RECORDED}
        for family in FAMILIES
    }


def run(folder: Path = FOLDER, seeds: int = 10, epochs: int = EPOCHS, days: tuple[int, ...] = TESTED) -> None:
    """Train all families, play their policies, and write the three kinds of file and their checksums.

    Args:
        folder: where to; the list of checksums is beside it.
        seeds: how many of each family.
        epochs: of training.
        days: on which the policies are played.
    """
    folder.mkdir(parents=True, exist_ok=True)
    curves, returns = [], []
    for family in FAMILIES:
        trainer = Trainer(plan(family, seeds, epochs), GreenhouseBatch)
        for epoch in range(epochs):
            record = trainer.epoch()
            note_sigma(trainer, record)
            for seed in range(seeds):
                measured = {name: float(record[name][seed]) for name in RECORDED}
                curves.append({"family": family, "seed": seed, "epoch": epoch, **measured})
        save_policies(folder / f"{family}.safetensors", trainer)
        for policy in policies(family, folder):
            for way, act in actors(policy).items():
                for day, earned in zip(days, play(act, GreenhouseBatch, days), strict=True):
                    row = {"family": family, "seed": policy.seed, "way": way, "day": day}
                    returns.append({**row, "return": earned})
        print(f"{family}: done", flush=True)
    _write(folder / "curves.parquet", curves)
    _write(folder / "returns.parquet", returns)
    files = sorted(folder.glob("[!.]*"))
    StudyFolder(folder.parent).publish({path: path.read_bytes() for path in files})


def _rows(table: pa.Table, **values: str) -> pa.Table:
    """Return the rows in which columns have these values."""
    for name, value in values.items():
        table = table.filter(pc.equal(table[name], value))
    return table


def _square(rows: pa.Table, first: str, second: str, name: str) -> Floats:
    """Return a column as an array, its axes the values of two others, each pair of which has one row."""
    a, b = (np.unique(rows[axis].to_numpy()) for axis in (first, second))
    if rows.num_rows != len(a) * len(b):
        raise ValueError(f"{rows.num_rows} rows for {len(a)} of {first} and {len(b)} of {second}")
    order = np.lexsort((rows[second].to_numpy(), rows[first].to_numpy()))
    return rows[name].to_numpy()[order].reshape(len(a), len(b)).astype(np.float64)


def _write(path: Path, rows: list[dict[str, Any]]) -> None:
    table = pa.Table.from_pylist(rows)
    schema = pa.schema(
        [pa.field(f.name, pa.float32() if pa.types.is_floating(f.type) else f.type) for f in table.schema]
    )
    pq.write_table(table.cast(schema), path, compression="zstd")


if __name__ == "__main__":
    run()
