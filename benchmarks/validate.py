"""Does Gaussian PPO learn here what it learns in stable-baselines3? Learning curves side by side.

Both sides run stable-baselines3's defaults: one free σ per dimension, ε = 0.2, no entropy bonus, observations as they
are (or, asked for, normalised), returns in training per epoch of 2048 steps. The areas under the curves are compared
by two one-sided tests: are the means within 15 % of the peer's? What is finished is kept: an interrupted validation
goes on where it was. Stored verdicts are replaced only by as many seeds under the same settings; others go to
`benchmarks/results/some`.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from numpy.typing import NDArray
from rich.console import Console

from benchmarks.equivalence import area, equivalence, seeds_needed
from benchmarks.published import RESULTS, Extent, place, read, write_text
from benchmarks.run import machine, versions
from benchmarks.side_by_side import OURS, PEER, Job, jobs, run_jobs
from inbounds.study.running.many_cells import cores

EXAMPLES = """
examples:
  python -m benchmarks.validate                       10 seeds, 307 200 steps, two robots; about 45 minutes on two cores
  python -m benchmarks.validate --seeds 20            ten more seeds than before: what is there is not run again
  python -m benchmarks.validate --seeds 10 20         ten on Hopper, twenty on HalfCheetah, as is stored
  python -m benchmarks.validate --quick               does it run? half a minute
"""


def curves(table: pa.Table, env: str, who: str) -> NDArray[np.float64]:
    """Return the returns `[seeds, epochs]` of one side on one robot."""
    rows = table.filter((pc.field("env") == env) & (pc.field("who") == who)).sort_by(
        [("seed", "ascending"), ("env_steps", "ascending")]
    )
    return rows["return_mean"].to_numpy().reshape(len(rows["seed"].unique()), -1)


def in_groups(values: NDArray[Any], together: int) -> NDArray[np.float64]:
    """Return means `[..., T // together]` of values `[..., T]`; a rest at the end is left out."""
    whole = values.shape[-1] // together * together
    return np.nanmean(values[..., :whole].reshape(*values.shape[:-1], -1, together), -1)


def summary(values: Mapping[str, NDArray[np.float64]], name: str) -> dict[str, Any]:
    """Return each side's mean, standard deviation, and its values under their name, one a seed."""
    return {who: {"mean": a.mean(), "std": a.std(ddof=1), name: a.tolist()} for who, a in values.items()}


def compared(ours: NDArray[np.float64], theirs: NDArray[np.float64], margin: float) -> dict[str, Any]:
    """Return ratio, interval, p-value, verdict and seeds needed; or as `undecided` why there is none."""
    try:
        found = dataclasses.asdict(equivalence(ours, theirs, margin))
        return found | {"seeds_needed": seeds_needed(ours, theirs, margin)}
    except ValueError as error:
        return {"undecided": str(error)}


def judge(table: pa.Table, env: str, margin: float) -> dict[str, Any]:
    """Return the verdict on one robot: areas, ratio, interval, p-value; or why there is none."""
    areas = {who: area(curves(table, env, who)) for who in (OURS, PEER)}
    return summary(areas, "areas") | compared(areas[OURS], areas[PEER], margin)


def facts(verdicts: dict[str, Any]) -> str:
    """Return the verdicts' numbers as a sentence of an alt text."""
    return "; ".join(
        f"on {env} the mean area under our curves is {v['ratio']:.2f} of the peer's "
        f"(90 % interval {v['low']:.2f} to {v['high']:.2f})"
        for env, v in verdicts.items()
        if "ratio" in v
    )


def plot(
    table: pa.Table, verdicts: dict[str, Any], say: Callable[[dict[str, Any]], str] = facts
) -> tuple[Any, str]:
    """Return a figure, a panel per robot, and its alt text, which ends in what `say` makes of the verdicts."""
    import matplotlib.pyplot as plt
    from scipy import stats

    from inbounds.book.drawing import figures

    figures.use_style()
    fig, axes = plt.subplots(1, len(verdicts), figsize=(figures.WIDTH, 3.4), squeeze=False)
    looks = {OURS: (figures.SHADES[0], "-", "In Bounds"), PEER: (figures.SHADES[3], "--", PEER)}
    for ax, env in zip(axes[0], verdicts, strict=True):
        steps = np.unique(table.filter(pc.field("env") == env)["env_steps"].to_numpy())
        together = 10 if len(steps) > 100 else 1  # epochs a point: more points than dashes are a scribble
        steps = in_groups(steps, together)
        for who, (color, linestyle, label) in looks.items():
            returns = in_groups(curves(table, env, who), together)
            middle, count = np.nanmean(returns, 0), len(returns)
            half = stats.t.ppf(0.975, count - 1) * np.nanstd(returns, 0, ddof=1) / np.sqrt(count)
            ax.plot(steps / 1e3, middle, color=color, linestyle=linestyle, label=label)
            ax.fill_between(steps / 1e3, middle - half, middle + half, color=color, alpha=0.2, linewidth=0)
        ax.set(title=env, xlabel="env steps (thousands)")
    axes[0, 0].set(ylabel="return in training")
    axes[0, 0].legend(loc="upper left")
    shown = "Return against env steps, mean and 95 % interval over seeds, two lines per robot"
    return fig, f"{shown}: {say(verdicts)}."


def about(done: Sequence[Job]) -> dict[str, Any]:
    """Return how much the jobs train, as results say it: `seeds` by robot, and `env_steps` of each."""
    return {
        "seeds": {job.env: len(job.seeds) for job in done},
        "env_steps": done[0].epochs * done[0].horizon,
    }


def place_beside(file: Path, asked: Mapping[str, Any]) -> tuple[Path, str]:
    """Return the folder for results that are meant to replace a file, and why if it is another.

    Args:
        file: JSON with `seeds` by robot.
        asked: the part of the new results that says how much they measure: `seeds`, and settings.
    """
    stored = read(file)
    settings = asked.keys() - {"seeds"}
    held = None
    if stored is not None:
        held = Extent(stored["seeds"], {name: stored[name] for name in settings})
    return place(file.parent, held, Extent(asked["seeds"], {name: asked[name] for name in settings}))


def finish(
    done: Sequence[Job],
    file: Path,
    asked: Mapping[str, Any],
    judged: Callable[[pa.Table, str], dict[str, Any]],
    say: Callable[[dict[str, Any]], str] = facts,
) -> dict[str, Any]:
    """Gather the curves, judge, and write the verdicts; beside them `curves.parquet` and a plot.

    Args:
        done: jobs whose seeds are all finished, one per robot and side.
        file: JSON to write; the plot has its name.
        asked: how much was measured; part of the results.
        judged: returns the verdict on a robot from the curves.
        say: the verdicts as a sentence of the plot's alt text.

    Returns:
        What the file holds.
    """
    import matplotlib.pyplot as plt

    file.parent.mkdir(parents=True, exist_ok=True)
    table = pa.concat_tables([pq.read_table(job.curve_file(seed)) for job in done for seed in job.seeds])
    pq.write_table(table, file.with_name("curves.parquet"))
    verdicts = {env: judged(table, env) for env in dict.fromkeys(job.env for job in done)}
    results = {
        "date": time.strftime("%Y-%m-%d", time.gmtime()),
        "machine": machine(),
        "versions": versions({}),
        **asked,
        "verdicts": verdicts,
    }
    write_text(file, json.dumps(results, indent=1) + "\n")
    fig, alt = plot(table, verdicts, say)
    fig.savefig(file.with_suffix(".svg"), metadata={"Title": alt, "Date": None})
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
    parser.add_argument("--workers", type=int, default=cores(), help="processes, one thread each")
    parser.add_argument("--output", type=Path, default=RESULTS / "validation")
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
    asked = about(sides) | {"normalize_obs": chosen.normalize, "margin": chosen.margin}
    folder, why = place_beside(chosen.output / "validation.json", asked)
    if why:
        console.print(why, soft_wrap=True)
    if todo := jobs(sides):
        run_jobs(todo, chosen.workers, console)
    results = finish(
        sides, folder / "validation.json", asked, lambda table, env: judge(table, env, chosen.margin)
    )
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
