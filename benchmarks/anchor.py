"""The second study's anchor outside the engine: does a Gaussian learn here what it learns in stable-baselines3?

Both sides run stable-baselines3's PPO: one free σ per dimension, 1 at the start, observations normalised by running
statistics, rewards as they are. Compared is, per seed, the area under the learning curve minus the first epoch's mean
return of all seeds of both sides, by two one-sided tests within a margin that `results/PROTOCOL-2.md` fixed. What is
finished is kept: an interrupted run goes on where it was, ours from its checkpoint, the peer's with the next seed.
Stored verdicts are replaced only by as many seeds under the same settings; others go to `benchmarks/results/some`.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pyarrow as pa
from rich.console import Console

from benchmarks.equivalence import seeds_needed_within
from benchmarks.published import RESULTS
from benchmarks.side_by_side import OURS, PEER, Job, jobs, run_jobs
from benchmarks.validate import about, curves, finish, place_beside, summary
from inbounds.study import statistics
from inbounds.study.running.many_cells import cores

MARGINS: Mapping[str, float] = MappingProxyType({"Ant-v5": 170.0, "HalfCheetah-v5": 860.0})
"""In points of return, by robot: the protocol's."""
STEPS, HORIZON = 1_000_000, 2048
EXAMPLES = """
examples:
  python -m benchmarks.anchor                 both robots, ten seeds a side, a million steps each: many hours
  python -m benchmarks.anchor --workers 1     on one core; stop it with Ctrl-C, start it again to go on
  python -m benchmarks.anchor --quick         does it run? two minutes
"""


def epochs_of(steps: int, horizon: int) -> int:
    """Return the epochs after which at least so many env steps are done, as the peer counts them.

    Example:
        >>> epochs_of(1_000_000, 2048), epochs_of(2048, 1024)
        (489, 2)
    """
    return -(-steps // horizon)


def gains(table: pa.Table, env: str) -> tuple[dict[str, Any], float]:
    """Return each seed's area minus the start, by side, and the start: the first epoch's mean return of all seeds.

    Epochs without a return take the last known one, as the study's protocols say, at the end of a curve too: there
    `equivalence.area`, which the validation uses, finds no area.
    """
    known = {who: statistics.carry_forward(curves(table, env, who)) for who in (OURS, PEER)}
    start = float(np.mean(np.concatenate([returns[:, 0] for returns in known.values()])))
    return {who: statistics.area_under_curve(returns) - start for who, returns in known.items()}, start


def judge(table: pa.Table, env: str, margin: float) -> dict[str, Any]:
    """Return the verdict on one robot.

    Args:
        table: rows of `env`, `who`, `seed`, `env_steps` and `return_mean`.
        env: the robot.
        margin: in points of return.

    Returns:
        Gains of both sides; the difference of their means, its 90 % and 95 % interval, the p-value of two one-sided
        tests, the seeds a side that would settle it, and a word: equivalent, different (the whole 95 % interval lies
        beyond the margin) or undecided. With a seed that never had a return, the word is undecided and `reason` says
        so.
    """
    gain, start = gains(table, env)
    verdict: dict[str, Any] = {"margin": margin, "start": start, **summary(gain, "gains")}
    try:
        outcome = statistics.equivalence(gain[OURS], gain[PEER], margin)
        wider = statistics.equivalence(gain[OURS], gain[PEER], margin, level=0.025)
    except ValueError as error:
        return verdict | {"word": "undecided", "reason": str(error)}
    beyond = wider.low > margin or wider.high < -margin
    return verdict | {
        "difference": outcome.difference,
        "interval_90": [outcome.low, outcome.high],
        "interval_95": [wider.low, wider.high],
        "p_value": outcome.p_value,
        "seeds_needed": seeds_needed_within(gain[OURS], gain[PEER], margin),
        "word": "equivalent" if outcome.equivalent else "different" if beyond else "undecided",
    }


def sentence(env: str, verdict: Mapping[str, Any]) -> str:
    """Say a verdict with its numbers."""
    if "reason" in verdict:
        return f"{env}: undecided: {verdict['reason']}"
    (low, high), margin, count = verdict["interval_90"], verdict["margin"], len(verdict[OURS]["gains"])
    said = f"{env}: {verdict['word']} within ± {margin:g}: ours minus the peer's {verdict['difference']:.1f}"
    said += f", 90 % interval {low:.1f} to {high:.1f}, p = {verdict['p_value']:.4f}, {count} seeds a side"
    if verdict["word"] == "undecided":
        said += f"; {verdict['seeds_needed']} would settle it, were the means equal"
    return said


def parse(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """Return the command line's choices, checked."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.anchor",
        description=__doc__,
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--envs", nargs="+", default=list(MARGINS), choices=list(MARGINS), help="both")
    parser.add_argument("--seeds", type=int, default=10, help="of each side (10)")
    parser.add_argument("--engine", choices=("compiled", "autograd"), default="compiled", help="of our side")
    parser.add_argument("--workers", type=int, default=cores(), help="processes, one thread each")
    parser.add_argument("--nice", type=int, default=19, help="added to the processes' niceness (19)")
    parser.add_argument("--output", type=Path, default=RESULTS / "anchor")
    parser.add_argument(
        "--quick", action="store_true", help="2 seeds, 2 epochs of 1024 steps; writes to …/quick"
    )
    chosen = parser.parse_args(arguments)
    chosen.horizon, chosen.epochs = HORIZON, epochs_of(STEPS, HORIZON)
    if chosen.quick:
        chosen.seeds, chosen.horizon, chosen.epochs = 2, 1024, 2
        chosen.output = chosen.output / "quick"
    if chosen.seeds < 2 or chosen.workers < 1:
        parser.error("at least two seeds a side and one worker are needed")
    return chosen


def main(arguments: Sequence[str] | None = None) -> None:
    """Train what is missing, judge, write, and print the verdicts."""
    chosen = parse(arguments)
    os.nice(chosen.nice)  # inherited by the processes
    (chosen.output / "runs").mkdir(parents=True, exist_ok=True)
    console = Console()
    sides = [
        Job(
            env,
            who,
            tuple(range(chosen.seeds)),
            chosen.epochs,
            chosen.horizon,
            normalize=True,
            folder=chosen.output,
            engine=chosen.engine,
        )
        for env in chosen.envs
        for who in (OURS, PEER)
    ]
    asked = {"engine": chosen.engine, **about(sides)}
    folder, why = place_beside(chosen.output / "anchor.json", asked)
    if why:
        console.print(why, soft_wrap=True)
    if todo := jobs(sides):
        run_jobs(todo, chosen.workers, console)
    results = finish(
        sides,
        folder / "anchor.json",
        asked,
        lambda table, env: judge(table, env, MARGINS[env]),
        lambda found: "; ".join(sentence(*each) for each in found.items()),
    )
    for env, verdict in results["verdicts"].items():
        console.print(sentence(env, verdict), soft_wrap=True)


if __name__ == "__main__":
    main()
