"""The robots in JavaScript are the package's, step by step: MuJoCo's WebAssembly build lags Python's by versions.

A recorded state is set, one recorded action executed, and what follows compared: 50 steps a robot, of a trained policy
that acts with noise. Over many steps chaos takes over; `benchmarks/live.py` measures how soon.
"""

import copy
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from scipy import stats

from inbounds.book.live import record
from inbounds.book.live.in_node import run_cell
from inbounds.book.live.record import TOLERANCES
from inbounds.study.grid import ROBOTS, select
from inbounds.study.store import StudyFolder

STEP = """
return values.map((step) => {
  const { world, policy } = player;
  world.put(step);
  const parameters = policy.parameters(step.seen);
  const greedy = Object.fromEntries(["mean", "median", "mode"].map((way) =>
    [way, policy.inBox(policy.act(parameters, way, []).executed)]));
  world.tell(step.action);
  let done = null;
  while (!done) done = world.advance();
  return { obs: world.observe(), reward: done.reward, terminated: done.terminated, greedy };
});
"""


def worst(told: list[dict[str, Any]], recorded: list[dict[str, Any]]) -> dict[str, float]:
    """The largest deviation of each kind."""

    def off(name: str) -> float:
        ours, theirs = (np.array([each[name] for each in steps]) for steps in (recorded, told))
        return float((np.abs(theirs - ours) / (1 + np.abs(ours))).max())

    action = max(
        float(
            np.abs(np.array([each["greedy"][way] for each in told]) - [each[way] for each in recorded]).max()
        )
        for way in ("mean", "median", "mode")
    )
    return {"obs": off("obs"), "reward": off("reward"), "action": action}


@pytest.mark.parametrize("family", [pytest.param("gaussian", marks=pytest.mark.slow), "logit-normal"])
@pytest.mark.parametrize("robot", ROBOTS)
def test_a_step_is_the_same(engine: None, robot: str, family: str) -> None:
    (cell,) = select([f"standard-{robot.lower()}-ppo-{family}"])
    recorded = list(record.steps(cell, 0))
    assert len(recorded) == 50
    told = run_cell(STEP, cell, 0, recorded)
    assert [each["terminated"] for each in told] == [each["terminated"] for each in recorded]
    off = worst(told, recorded)
    assert off["obs"] < TOLERANCES.get(f"obs of {robot}", TOLERANCES["obs"])
    assert off["reward"] < TOLERANCES["reward"]
    assert off["action"] < TOLERANCES["action"]


def test_a_fall_ends_the_episode_in_both(engine: None) -> None:
    """Every step of a Hopper that falls within the record, so that there are ends to compare."""
    (cell,) = select(["standard-hopper-ppo-gaussian"])
    recorded = list(record.steps(cell, 0, count=600, apart=1))
    told = run_cell(STEP, cell, 0, recorded)
    ends = [each["terminated"] for each in recorded]
    assert any(ends)
    assert [each["terminated"] for each in told] == ends


def test_a_wrong_state_is_noticed(engine: None) -> None:
    (cell,) = select(["standard-halfcheetah-ppo-gaussian"])
    recorded = list(record.steps(cell, 0, count=3))
    moved = copy.deepcopy(recorded)
    for step in moved:
        step["qvel"][3] += 1e-3
    off = worst(run_cell(STEP, cell, 0, moved), recorded)
    assert off["obs"] > 10 * TOLERANCES["obs"]
    assert off["reward"] > 10 * TOLERANCES["reward"]


EPISODES = """
player.way = "sample";
const found = [];
for (let seed = 0; seed < values; seed++) found.push(live.episode(player, seed).total);
return found;
"""


@pytest.mark.slow
@pytest.mark.parametrize("robot", ROBOTS)
def test_episodes_earn_as_much(engine: None, robot: str) -> None:
    """Twenty episodes with noise in JavaScript, less the ten of the study: a 99.9 % interval (Welch) holds zero."""
    (cell,) = select([f"standard-{robot.lower()}-ppo-logit-normal"])
    rows = pq.read_table(StudyFolder.shipped().policy_files(cell)[1]).to_pylist()
    played = np.array([row["return"] for row in rows if row["seed"] == 0 and row["greedy"] == "sample"])
    assert len(played) == 10
    told = np.array(run_cell(EPISODES, cell, 0, 20))
    interval = stats.ttest_ind(told, played, equal_var=False).confidence_interval(0.999)
    assert interval.low < 0 < interval.high
    assert interval.high - interval.low < 2.5 * abs(played.mean())  # it says something
