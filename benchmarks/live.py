"""Is the robot in the browser the robot of the study? One step, a free run, and whole episodes, in node.

The page runs MuJoCo's WebAssembly build, some versions behind Python's. From a recorded state one step is repeated
with the same action; from a start the same policy then runs free in both, acting by its median, until the
observations part; and 20 episodes with noise are compared with those that the study played. What was found is in
`benchmarks/results/live.json`.

    python -m benchmarks.live          about ten minutes
    python -m benchmarks.live --quick  does it run? half a minute
"""

from __future__ import annotations

import argparse
import json
import time
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
from numpy.typing import NDArray
from scipy import stats

from benchmarks.run import machine, versions
from inbounds.book.live import record
from inbounds.book.live.export import robot as robot_of
from inbounds.book.live.in_node import run, run_cell
from inbounds.robots.vector_env import RobotVectorEnv
from inbounds.study.grid import ROBOTS, Cell, select
from inbounds.study.store import StudyFolder

TARGET = Path(__file__).parent / "results" / "live.json"
APART = 1e-2
"""Observations have parted where one differs by this much of 1 + its size."""
FREE = """
player.way = "median";
return values.starts.map((start) => {
  player.reset(0);
  player.world.put(start);
  player.decide();
  const seen = [];
  while (seen.length < values.steps && !player.over) {
    if (player.advance()) seen.push(player.world.observe());
  }
  return seen;
});
"""
EPISODES = """
player.way = "sample";
const began = performance.now();
const found = [];
for (let seed = 0; seed < values; seed++) found.push(live.episode(player, seed));
const steps = found.reduce((sum, each) => sum + each.steps, 0);
return { totals: found.map((each) => each.total), steps_a_second: (1000 * steps) / (performance.now() - began) };
"""


def one_step(cell: Cell, count: int) -> dict[str, float]:
    """Return the largest deviations after one step, relative to 1 + the size (an action's: absolute)."""
    from tests.book.live.test_parity import STEP, worst

    recorded = list(record.steps(cell, 0, count))
    return worst(run_cell(STEP, cell, 0, recorded), recorded)


def free_run(cell: Cell, starts: int, steps: int) -> list[int]:
    """Return after how many env steps the observations part, one number a start; `steps` where they do not."""
    policy = StudyFolder.shipped().load_policies(cell)[0]
    played, states = [], []
    for start in range(starts):
        with closing(RobotVectorEnv(cell.config.env, 1)) as env:
            obs, _ = env.reset(seed=start)
            data, seen, over = env.get_data(0), [], False
            states.append({"qpos": data.qpos.tolist(), "qvel": data.qvel.tolist()})
            while len(seen) < steps and not over:
                obs, _, terminated, _, infos = env.step(policy.act(obs, "median"))
                over = bool(terminated[0])
                seen.append(infos["final_obs"][0] if over else obs[0])
        played.append(np.array(seen, np.float64))
    told = run_cell(FREE, cell, 0, {"starts": states, "steps": steps})
    return [parted(ours, np.array(theirs)) for ours, theirs in zip(played, told, strict=True)]


def parted(ours: NDArray[Any], theirs: NDArray[Any]) -> int:
    """Return the first step whose observations `[T, O]` differ by more than `APART`, or how many there are."""
    length = min(len(ours), len(theirs))
    off = np.abs(ours[:length] - theirs[:length]) / (1 + np.abs(ours[:length]))
    steps = np.flatnonzero((off > APART).any(axis=1))
    return int(steps[0]) if steps.size else length


def episodes(cell: Cell, count: int) -> dict[str, Any]:
    """Return the returns of both, and the 95 % interval of the difference of their means (Welch)."""
    told = run_cell(EPISODES, cell, 0, count)
    rows = pq.read_table(StudyFolder.shipped().policy_files(cell)[1]).to_pylist()
    played = [row["return"] for row in rows if row["seed"] == 0 and row["greedy"] == "sample"]
    interval = stats.ttest_ind(told["totals"], played, equal_var=False).confidence_interval(0.95)
    return told | {
        "study": played,
        "difference": float(np.mean(told["totals"]) - np.mean(played)),
        "low": float(interval.low),
        "high": float(interval.high),
    }


def main() -> None:
    """Measure, print, and store what was found."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="few steps and episodes; writes nothing")
    quick = parser.parse_args().quick
    began, found = time.perf_counter(), {}
    for robot in ROBOTS:
        (cell,) = select([f"standard-{robot.lower()}-ppo-logit-normal"])
        found[robot] = {
            "cell": cell.id,
            "one_step": one_step(cell, 5 if quick else 50),
            "free_run": free_run(cell, 2 if quick else 10, 50 if quick else 400),
            "episodes": episodes(cell, 2 if quick else 20),
            "dt": run("return new live.World(mujoco, values).dt", robot_of(cell.robot)),
        }
        print(robot, json.dumps(found[robot]), f"({time.perf_counter() - began:.0f} s)", flush=True)
    engine = run("return mujoco.mj_versionString()")
    about = {"wasm": engine, "machine": machine(), "versions": versions({})}
    if not quick:
        TARGET.write_text(json.dumps(about | {"robots": found}, indent=1) + "\n", encoding="utf8")


if __name__ == "__main__":
    main()
