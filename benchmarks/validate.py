"""Does Gaussian PPO learn here what it learns in stable-baselines3? Learning curves side by side.

Both sides run stable-baselines3's defaults: one free σ per dimension, ε = 0.2, no entropy bonus, observations as they
are (or, asked for, normalised), returns in training per epoch of 2048 steps. The areas under the curves are compared
by two one-sided tests: are the means within 15 % of the peer's? What is finished is kept: an interrupted validation
goes on where it was.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import multiprocessing
import os
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from benchmarks.equivalence import area, equivalence, seeds_needed
from benchmarks.run import machine, versions
from benchmarks.worker import THREADS

ROOT = Path(__file__).resolve().parents[1]
OURS, PEER = "inbounds", "stable-baselines3"
EXAMPLES = """
examples:
  python -m benchmarks.validate                       10 seeds, 307 200 steps, two robots; about 45 minutes on two cores
  python -m benchmarks.validate --seeds 20            ten more seeds than before: what is there is not run again
  python -m benchmarks.validate --seeds 10 20         ten on Hopper, twenty on HalfCheetah
  python -m benchmarks.validate --quick               does it run? half a minute
"""
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

    @property
    def name(self) -> str:
        """Of its files: what its curves depend on, but for the seed."""
        seen = "normalized" if self.normalize else "raw"
        return f"{self.env}-{self.who}-{self.epochs}x{self.horizon}-{seen}"

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


def train_ours(job: Job, on_epoch: Callable[[], None]) -> None:
    """Train all seeds of the job in lockstep, from the checkpoint if there is one."""
    from inbounds.learning import preset, train

    config = preset("common", job.env, policy="gaussian", seeds=job.seeds, epochs=job.epochs)
    config = dataclasses.replace(
        config,
        policy=dataclasses.replace(config.policy, state_dependent_std=False),
        algorithm=dataclasses.replace(config.algorithm, entropy_coef=0.0, horizon=job.horizon),
        normalize_obs=job.normalize,
    )
    run_dir = job.folder / "runs" / f"{job.name}-{'-'.join(map(str, job.seeds))}"
    run = train(config, run_dir=run_dir, callback=lambda *_: on_epoch())
    if run.diverged.any():
        raise RuntimeError(f"{job.env}: seeds {np.array(job.seeds)[run.diverged].tolist()} diverged")
    for i, seed in enumerate(job.seeds):
        job.keep(seed, [r["return_mean"][i] for r in run.records], [r["episodes"][i] for r in run.records])


def train_peer(job: Job, on_epoch: Callable[[], None]) -> None:
    """Train the one seed of the job."""
    from stable_baselines3 import PPO
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.env_util import make_vec_env
    from stable_baselines3.common.vec_env import VecNormalize

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

    (seed,) = job.seeds
    epochs = Epochs()
    envs: Any = make_vec_env(job.env, seed=seed)
    if job.normalize:
        envs = VecNormalize(envs, norm_reward=False)
    model = PPO("MlpPolicy", envs, n_steps=job.horizon, seed=seed, device="cpu")
    model.learn(job.epochs * job.horizon, callback=epochs)
    job.keep(
        seed, [float(np.mean(r)) if r else np.nan for r in epochs.finished], [len(r) for r in epochs.finished]
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


def curves(table: pa.Table, env: str, who: str) -> NDArray[np.float64]:
    """Return the returns `[seeds, epochs]` of one side on one robot."""
    rows = table.filter((pc.field("env") == env) & (pc.field("who") == who)).sort_by(
        [("seed", "ascending"), ("env_steps", "ascending")]
    )
    return rows["return_mean"].to_numpy().reshape(len(rows["seed"].unique()), -1)


def judge(table: pa.Table, env: str, margin: float) -> dict[str, Any]:
    """Return the verdict on one robot: areas, ratio, interval, p-value; or why there is none."""
    areas = {who: area(curves(table, env, who)) for who in (OURS, PEER)}
    verdict: dict[str, Any] = {
        who: {"mean": a.mean(), "std": a.std(ddof=1), "areas": a.tolist()} for who, a in areas.items()
    }
    try:
        verdict |= dataclasses.asdict(equivalence(areas[OURS], areas[PEER], margin))
        verdict["seeds_needed"] = seeds_needed(areas[OURS], areas[PEER], margin)
    except ValueError as error:
        verdict["undecided"] = str(error)
    return verdict


def plot(table: pa.Table, verdicts: dict[str, Any]) -> tuple[Any, str]:
    """Return a figure, a panel per robot, and its alt text."""
    import matplotlib.pyplot as plt
    from scipy import stats

    from inbounds.book.drawing import figures

    figures.use_style()
    fig, axes = plt.subplots(1, len(verdicts), figsize=(figures.WIDTH, 3.4), squeeze=False)
    looks = {OURS: (figures.SHADES[0], "-", "In Bounds"), PEER: (figures.SHADES[3], "--", PEER)}
    for ax, env in zip(axes[0], verdicts, strict=True):
        steps = np.unique(table.filter(pc.field("env") == env)["env_steps"].to_numpy())
        for who, (color, linestyle, label) in looks.items():
            returns = curves(table, env, who)
            middle, count = np.nanmean(returns, 0), len(returns)
            half = stats.t.ppf(0.975, count - 1) * np.nanstd(returns, 0, ddof=1) / np.sqrt(count)
            ax.plot(steps / 1e3, middle, color=color, linestyle=linestyle, label=label)
            ax.fill_between(steps / 1e3, middle - half, middle + half, color=color, alpha=0.2, linewidth=0)
        ax.set(title=env, xlabel="env steps (thousands)")
    axes[0, 0].set(ylabel="return in training")
    axes[0, 0].legend(loc="upper left")
    facts = [
        f"on {env} the mean area under our curves is {v['ratio']:.2f} of the peer's "
        f"(90 % interval {v['low']:.2f} to {v['high']:.2f})"
        for env, v in verdicts.items()
        if "ratio" in v
    ]
    return (
        fig,
        "Return against env steps, mean and 95 % interval over seeds, two lines per robot: "
        + "; ".join(facts)
        + ".",
    )


def finish(done: Sequence[Job], margin: float) -> dict[str, Any]:
    """Gather the curves, judge, and write `curves.parquet`, `validation.json` and `validation.svg`.

    Args:
        done: jobs whose seeds are all finished, one per robot and side.
        margin: relative.

    Returns:
        What `validation.json` holds.
    """
    import matplotlib.pyplot as plt

    folder = done[0].folder
    table = pa.concat_tables([pq.read_table(job.curve_file(seed)) for job in done for seed in job.seeds])
    pq.write_table(table, folder / "curves.parquet")
    verdicts = {env: judge(table, env, margin) for env in dict.fromkeys(job.env for job in done)}
    results = {
        "date": time.strftime("%Y-%m-%d", time.gmtime()),
        "machine": machine(),
        "versions": versions({}),
        "seeds": {job.env: len(job.seeds) for job in done},
        "env_steps": done[0].epochs * done[0].horizon,
        "normalize_obs": done[0].normalize,
        "margin": margin,
        "verdicts": verdicts,
    }
    (folder / "validation.json").write_text(json.dumps(results, indent=1) + "\n", encoding="utf8")
    fig, alt = plot(table, verdicts)
    fig.savefig(folder / "validation.svg", metadata={"Title": alt, "Date": None})
    plt.close(fig)
    return results


def main(arguments: Sequence[str] | None = None) -> None:
    """Train what is missing, judge, write, and print the verdicts."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.validate",
        description=__doc__,
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--envs", nargs="+", default=["Hopper-v5", "HalfCheetah-v5"], help="Gymnasium's ids")
    parser.add_argument(
        "--seeds", type=int, nargs="+", default=[10], help="of each side (10): one number, or one per robot"
    )
    parser.add_argument("--epochs", type=int, default=150, help="of 2048 steps each (150)")
    parser.add_argument(
        "--normalize", action="store_true", help="observations, by running statistics, on both sides"
    )
    parser.add_argument("--margin", type=float, default=0.15, help="relative, of equivalence (0.15)")
    parser.add_argument(
        "--workers", type=int, default=len(os.sched_getaffinity(0)), help="processes, one thread each"
    )
    parser.add_argument("--output", type=Path, default=ROOT / "benchmarks" / "results" / "validation")
    parser.add_argument(
        "--quick", action="store_true", help="2 seeds, 2 epochs of 256 steps; writes to …/quick"
    )
    chosen = parser.parse_args(arguments)
    horizon = 2048
    if chosen.quick:
        chosen.seeds, chosen.epochs, horizon = [2], 2, 256
        chosen.envs, chosen.output = chosen.envs[:1], chosen.output / "quick"
    if len(chosen.seeds) not in (1, len(chosen.envs)):
        parser.error(
            f"{len(chosen.seeds)} numbers of seeds for {len(chosen.envs)} robots: give one, or one per robot"
        )
    counts = chosen.seeds if len(chosen.seeds) > 1 else chosen.seeds * len(chosen.envs)
    if min(counts) < 2 or chosen.epochs < 1 or chosen.workers < 1:
        parser.error("at least two seeds a side, one epoch and one worker are needed")
    (chosen.output / "runs").mkdir(parents=True, exist_ok=True)
    console = Console()
    sides = [
        Job(env, who, tuple(range(count)), chosen.epochs, horizon, chosen.normalize, chosen.output)
        for env, count in zip(chosen.envs, counts, strict=True)
        for who in (OURS, PEER)
    ]
    if todo := jobs(sides):
        run_jobs(todo, chosen.workers, console)
    results = finish(sides, chosen.margin)
    for env, verdict in results["verdicts"].items():
        if "undecided" in verdict:
            console.print(f"{env}: undecided: {verdict['undecided']}")
            continue
        word = "equivalent" if verdict["equivalent"] else "not shown to be equivalent"
        interval = f"{verdict['ratio']:.3f}, 90 % interval {verdict['low']:.3f} to {verdict['high']:.3f}"
        console.print(
            f"{env}: {word} within ± {chosen.margin:.0%}: ratio {interval}, p = {verdict['p_value']:.4f}"
        )


if __name__ == "__main__":
    main()
