"""Training both sides: our seeds in lockstep, the peer's each in a process of its own; what is finished is kept."""

from __future__ import annotations

import dataclasses
import multiprocessing
import os
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from benchmarks.worker import THREADS

OURS, PEER = "inbounds", "stable-baselines3"
_epochs_done: Any = None  # a counter shared by all processes


@dataclasses.dataclass(frozen=True)
class Job:
    """Seeds of one side on one robot, trained by one process."""

    env: str
    who: str
    seeds: tuple[int, ...]
    epochs: int
    horizon: int
    normalize: bool
    folder: Path
    engine: Literal["autograd", "compiled"] = "autograd"  # of our side

    @property
    def name(self) -> str:
        """Of its files: what its curves depend on, but for the seed."""
        seen = "normalized" if self.normalize else "raw"
        engine = f"-{self.engine}" if self.who == OURS and self.engine != "autograd" else ""
        return f"{self.env}-{self.who}-{self.epochs}x{self.horizon}-{seen}{engine}"

    def curve_file(self, seed: int) -> Path:
        """Return where a finished seed's curve lies."""
        return self.folder / "runs" / f"{self.name}-{seed}.parquet"

    def keep(self, seed: int, returns: Sequence[float], episodes: Sequence[int]) -> None:
        """Write a finished seed's curve, whole or not at all."""
        columns = {
            "env": [self.env] * self.epochs,
            "who": [self.who] * self.epochs,
            "seed": [seed] * self.epochs,
            "env_steps": [self.horizon * (epoch + 1) for epoch in range(self.epochs)],
            "return_mean": np.asarray(returns, np.float64),
            "episodes": np.asarray(episodes, np.int64),
        }
        path = self.curve_file(seed)
        pq.write_table(pa.table(columns), path.with_suffix(".partial"))
        os.replace(path.with_suffix(".partial"), path)


def our_config(job: Job) -> Any:
    """Return our configuration with the peer's numbers."""
    from inbounds.learning import preset

    config = preset("common", job.env, policy="gaussian", seeds=job.seeds, epochs=job.epochs)
    return dataclasses.replace(
        config,
        policy=dataclasses.replace(config.policy, state_dependent_std=False),
        algorithm=dataclasses.replace(config.algorithm, entropy_coef=0.0, horizon=job.horizon),
        normalize_obs=job.normalize,
        engine=job.engine,
    )


def train_ours(job: Job, on_epoch: Callable[[], None]) -> None:
    """Train all seeds of the job in lockstep, from the checkpoint if there is one."""
    from inbounds.learning import train

    run_dir = job.folder / "runs" / f"{job.name}-{'-'.join(map(str, job.seeds))}"
    run = train(our_config(job), run_dir=run_dir, callback=lambda *_: on_epoch())
    if run.diverged.any():
        raise RuntimeError(f"{job.env}: seeds {np.array(job.seeds)[run.diverged].tolist()} diverged")
    for i, seed in enumerate(job.seeds):
        job.keep(seed, [r["return_mean"][i] for r in run.records], [r["episodes"][i] for r in run.records])


def peer_model(job: Job) -> Any:
    """Return the peer, its defaults but for the horizon, for the one seed of the job."""
    from stable_baselines3 import PPO
    from stable_baselines3.common.env_util import make_vec_env
    from stable_baselines3.common.vec_env import VecNormalize

    (seed,) = job.seeds
    envs: Any = make_vec_env(job.env, seed=seed)
    if job.normalize:
        envs = VecNormalize(envs, norm_reward=False)
    return PPO("MlpPolicy", envs, n_steps=job.horizon, seed=seed, device="cpu")


def train_peer(job: Job, on_epoch: Callable[[], None]) -> None:
    """Train the one seed of the job."""
    from stable_baselines3.common.callbacks import BaseCallback

    class Epochs(BaseCallback):
        def __init__(self) -> None:
            super().__init__()
            self.finished: list[list[float]] = []

        def _on_rollout_start(self) -> None:
            self.finished.append([])

        def _on_step(self) -> bool:
            self.finished[-1] += [info["episode"]["r"] for info in self.locals["infos"] if "episode" in info]
            return True

        def _on_rollout_end(self) -> None:
            on_epoch()

    epochs = Epochs()
    peer_model(job).learn(job.epochs * job.horizon, callback=epochs)
    job.keep(
        *job.seeds,
        [float(np.mean(r)) if r else np.nan for r in epochs.finished],
        [len(r) for r in epochs.finished],
    )


def work_off(job: Job) -> None:
    """Do a job in this process, on one thread."""
    import torch

    torch.set_num_threads(1)

    def on_epoch() -> None:
        with _epochs_done.get_lock():
            _epochs_done.value += len(job.seeds)

    (train_ours if job.who == OURS else train_peer)(job, on_epoch)


def _share(counter: Any) -> None:
    global _epochs_done  # noqa: PLW0603
    _epochs_done = counter


def jobs(whole: Sequence[Job]) -> list[Job]:
    """Return what of these jobs is still to be done, split as it is trained, the longest first.

    Our seeds are trained in lockstep by one process, the peer's each by one of its own.
    """
    todo = []
    for job in whole:
        missing = tuple(s for s in job.seeds if not job.curve_file(s).exists())
        groups = [missing] if job.who == OURS and missing else [(s,) for s in missing]
        todo += [dataclasses.replace(job, seeds=seeds) for seeds in groups]
    return sorted(todo, key=lambda job: len(job.seeds), reverse=True)


def run_jobs(todo: Sequence[Job], workers: int, console: Console) -> None:
    """Do the jobs, each in a process of its own, and show how far they are."""
    context = multiprocessing.get_context("spawn")
    counter = context.Value("q", 0)
    os.environ.update(dict.fromkeys(THREADS, "1"))  # inherited by the processes
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(elapsed_when_finished=True),
    )
    with (
        Progress(*columns, console=console) as progress,
        ProcessPoolExecutor(workers, context, _share, (counter,), max_tasks_per_child=1) as pool,
    ):
        task = progress.add_task("epochs × seeds", total=sum(len(job.seeds) * job.epochs for job in todo))
        futures = [pool.submit(work_off, job) for job in todo]
        while not all(future.done() for future in futures):
            progress.update(task, completed=counter.value)
            time.sleep(0.5)
        progress.update(task, completed=counter.value)
        for future in futures:
            future.result()
