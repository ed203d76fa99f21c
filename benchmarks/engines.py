"""Does the engine `compiled` learn what `autograd` learns? Learning curves of different seeds, side by side.

Runs of the two engines part after a few updates, so they are compared as two sets of seeds are: by two one-sided tests
on the areas under the curves (`benchmarks.equivalence`). The preset `common`, the logit-normal by default. What is
finished is kept: an interrupted comparison goes on where it was. Stored verdicts are replaced only by as many seeds
under the same settings; others go to `benchmarks/results/some`.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from benchmarks.equivalence import area
from benchmarks.published import RESULTS, Extent, place, read, write_text
from benchmarks.run import machine, versions
from benchmarks.validate import Job, compared, curves

HORIZON = 2048
ORACLE, NEW = "autograd", "compiled"
EXAMPLES = """
examples:
  python -m benchmarks.engines                                  10 seeds a side, 150 epochs, two robots; about an hour
  python -m benchmarks.engines --seeds 30                       as many as the first run said that it takes
  python -m benchmarks.engines --envs Hopper-v5 --seeds 40      what is stored
  python -m benchmarks.engines --envs Swimmer-v5 --epochs 30    a small one; three minutes
"""


def train_side(job: Job, policy: str, algo: str) -> None:
    """Train the seeds of one engine in lockstep, on one thread, and keep their curves."""
    from inbounds.learning import preset, train

    config = preset("common", job.env, policy=policy, algo=algo, seeds=job.seeds, epochs=job.epochs)
    algorithm = dataclasses.replace(config.algorithm, horizon=job.horizon)
    config = dataclasses.replace(config, algorithm=algorithm, engine=job.who)
    run_dir = job.folder / "runs" / f"{job.name}-{job.seeds[0]}-{job.seeds[-1]}"
    run = train(config, run_dir=run_dir)
    for i, seed in enumerate(job.seeds):
        job.keep(seed, [r["return_mean"][i] for r in run.records], [r["episodes"][i] for r in run.records])


def judge(done: Sequence[Job], margin: float) -> dict[str, Any]:
    """Return the verdict on the robot of two finished jobs: the oracle's and the new engine's."""
    rows = pa.concat_tables([pq.read_table(job.curve_file(seed)) for job in done for seed in job.seeds])
    areas = {job.who: area(curves(rows, job.env, job.who)) for job in done}
    verdict: dict[str, Any] = {who: values.tolist() for who, values in areas.items()}
    return verdict | compared(areas[NEW], areas[ORACLE], margin)


def in_words(env: str, verdict: dict[str, Any], margin: float) -> str:
    """Return one line about one robot.

    Example:
        >>> in_words("Hopper-v5", {"undecided": "train longer"}, 0.15)
        'Hopper-v5: undecided: train longer'
    """
    if "undecided" in verdict:
        return f"{env}: undecided: {verdict['undecided']}"
    word = "equivalent" if verdict["equivalent"] else "not shown to be equivalent"
    return (
        f"{env}: {word} within ± {margin:.0%}: ratio {verdict['ratio']:.3f}, 90 % interval {verdict['low']:.3f} to "
        f"{verdict['high']:.3f}, p = {verdict['p_value']:.4f}; {verdict['seeds_needed']} seeds a side would do"
    )


def held(file: Path) -> Extent | None:
    """Return how much stored verdicts hold, or None if there are none."""
    if (stored := read(file)) is None:
        return None
    settings = {"env_steps": stored["env_steps"], "horizon": stored.get("horizon", HORIZON)}
    return Extent(dict.fromkeys(stored["verdicts"], stored["seeds"]), settings | {"margin": stored["margin"]})


def main(arguments: Sequence[str] | None = None) -> None:
    """Train what is missing, judge, write `engines.json`, and print the verdicts."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.engines",
        description=__doc__,
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--envs", nargs="+", default=["Hopper-v5", "HalfCheetah-v5"], help="ids of robots")
    parser.add_argument("--seeds", type=int, default=10, help="of each side (10)")
    parser.add_argument("--epochs", type=int, default=150, help="rollouts of each seed (150)")
    parser.add_argument("--horizon", type=int, default=HORIZON, help="env steps of a rollout (2048)")
    parser.add_argument("--policy", default="logit-normal", help="the family (logit-normal)")
    parser.add_argument("--algo", default="ppo", help="ppo or trpo (ppo)")
    parser.add_argument("--margin", type=float, default=0.15, help="relative, of equivalence (0.15)")
    parser.add_argument("--output", type=Path, default=RESULTS / "engines")
    chosen = parser.parse_args(arguments)
    if chosen.seeds < 2:
        parser.error("at least two seeds a side are needed")
    folder = chosen.output / f"{chosen.algo}-{chosen.policy}"
    (folder / "runs").mkdir(parents=True, exist_ok=True)
    settings = {
        "env_steps": chosen.epochs * chosen.horizon,
        "horizon": chosen.horizon,
        "margin": chosen.margin,
    }
    measured = Extent(dict.fromkeys(chosen.envs, chosen.seeds), settings)
    target, why = place(folder, held(folder / "engines.json"), measured)
    if why:
        print(why, flush=True)
    verdicts = {}
    for env in chosen.envs:
        sides = [  # different seeds: the tests are for two independent samples
            Job(
                env,
                who,
                tuple(range(first, first + chosen.seeds)),
                chosen.epochs,
                chosen.horizon,
                True,
                folder,
            )
            for who, first in ((ORACLE, 0), (NEW, 1000))
        ]
        for job in sides:
            missing = tuple(seed for seed in job.seeds if not job.curve_file(seed).exists())
            if missing:
                train_side(dataclasses.replace(job, seeds=missing), chosen.policy, chosen.algo)
        verdicts[env] = judge(sides, chosen.margin)
        print(in_words(env, verdicts[env], chosen.margin), flush=True)
    about = {"machine": machine(), "versions": versions({}), "seeds": chosen.seeds, **settings}
    write_text(target / "engines.json", json.dumps({**about, "verdicts": verdicts}, indent=1) + "\n")


if __name__ == "__main__":
    main()
