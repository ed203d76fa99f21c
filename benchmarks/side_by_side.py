"""Training both sides: our seeds in lockstep, the peer's each in a process of its own; what is finished is kept."""

from __future__ import annotations

import dataclasses
import multiprocessing
import os
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
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


def run_jobs(
    todo: Sequence[Job], workers: int, console: Console, do: Callable[[Job], None] = work_off
) -> None:
    """Do the jobs, each in a process of its own, and show how far they are.

    A job that fails is told at once, and the others go on. Whatever ends this early, as Ctrl-C does, ends the processes
    too: the pool by itself would wait for them, and start jobs that it has handed out already.

    Args:
        todo: the jobs, in order.
        workers: how many at a time.
        console: to show it on.
        do: does one job.

    Raises:
        RuntimeError: a job failed.
    """
    context = multiprocessing.get_context("spawn")
    counter = context.Value("q", 0)
    os.environ.update(dict.fromkeys(THREADS, "1"))  # inherited by the processes
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(elapsed_when_finished=True),
    )
    failures: list[BaseException] = []
    others = multiprocessing.active_children()
    with (
        Progress(*columns, console=console) as progress,
        ProcessPoolExecutor(workers, context, _share, (counter,), max_tasks_per_child=1) as pool,
    ):
        task = progress.add_task("epochs × seeds", total=sum(len(job.seeds) * job.epochs for job in todo))
        try:
            jobs_of = {pool.submit(do, job): job for job in todo}
            left = set(jobs_of)
            while left:
                done, left = wait(left, timeout=0.5, return_when=FIRST_COMPLETED)
                progress.update(task, completed=counter.value)
                for future in done:
                    if (error := future.exception()) is not None:
                        job = jobs_of[future]
                        seeds = ", ".join(map(str, job.seeds))
                        console.print(f"{job.name}, seeds {seeds}, failed: {error!r}", markup=False)
                        failures.append(error)
                    if isinstance(error, BrokenProcessPool):  # and with it all the others
                        raise error
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            while ours := [child for child in multiprocessing.active_children() if child not in others]:
                for process in ours:
                    process.terminate()
                for process in ours:
                    process.join(1)
            raise
    if failures:
        raise RuntimeError(
            f"{len(failures)} of {len(todo)} jobs failed, as told above; the others are kept"
        ) from failures[0]
