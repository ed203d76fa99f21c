"""Returns of whole episodes, and leads over a rival: of seeds by seed, of days by day."""

import numpy as np
import pytest

from inbounds.book.own_task import best_of, compare, constant, play
from inbounds.book.own_task.greenhouse import GreenhouseBatch
from inbounds.study.statistics import mean_of
from tests.learning.point import PointEnv


def test_an_episode_is_counted_once() -> None:
    """A finished episode earns no more, though its environment goes on; these end after different times."""
    days, freeze = [4, 5, 6], np.float32([-2, 1])
    envs, expected, running, lengths = GreenhouseBatch(3), np.zeros(3), np.ones(3, bool), set()
    envs.reset(seed=days)
    for step in range(200):
        _, reward, terminated, truncated, _ = envs.step(np.tile(freeze, (3, 1)))
        expected[running] += reward[running]
        lengths |= {step} if (running & (terminated | truncated)).any() else set()
        running &= ~(terminated | truncated)
    assert len(lengths) > 1
    np.testing.assert_allclose(play(constant(freeze), GreenhouseBatch, days), expected)


def test_an_episode_without_end_is_refused() -> None:
    class Endless(PointEnv):
        def step(self, actions):
            obs, reward, ended, *_, info = super().step(actions)
            return obs, reward, np.zeros_like(ended), np.zeros_like(ended), info

    with pytest.raises(RuntimeError, match="2 of 2 episodes go on"):
        play(constant([0.0] * PointEnv(1).single_action_space.shape[0]), Endless, [0, 1], limit=50)


def test_the_best_is_chosen_by_the_mean() -> None:
    dims = PointEnv(1).single_action_space.shape[0]
    actors = {name: constant([value] * dims) for name, value in (("still", 0.0), ("pushed", 1.0))}
    best, earned = best_of(actors, PointEnv, range(8))
    assert earned[best] == max(earned.values())
    assert earned["still"] == pytest.approx(play(actors["still"], PointEnv, range(8)).mean())


def test_leads_are_paired_by_day_and_resampled_by_what_is_random() -> None:
    rng = np.random.default_rng(0)
    days = rng.normal(50, 20, 200)  # good days and bad days, the same for all
    found = compare(
        {
            "rule": days,
            "better": days + rng.normal(1, 0.5, 200),
            "policies": days + rng.normal(3, 1, (10, 1)),
            "noise": days + rng.normal(0, 1, (10, 1)) * 4,
        },
        "rule",
    )
    assert found["rule"][1] is None
    better, policies, noise = (found[name][1] for name in ("better", "policies", "noise"))
    assert better is not None
    assert policies is not None
    assert noise is not None
    assert 0.8 < better.low < better.high < 1.2  # the days' spread of 20 is gone
    assert policies.low > 1
    assert policies.n == 10
    assert better.n == 200
    assert noise.low < 0 < noise.high


def test_an_interval_does_not_depend_on_who_else_is_there() -> None:
    days = np.random.default_rng(0).normal(50, 20, 200)
    policies = days + np.random.default_rng(1).normal(3, 1, (10, 1))
    mean, lead = compare({"rule": days, "policies": policies}, "rule")["policies"]
    others = {"better": days + 1, "rule": days, "policies": policies}
    assert compare(others, "rule")["policies"] == (mean, lead)
    assert mean == mean_of(policies.mean(1))


def test_what_cannot_be_compared_is_refused() -> None:
    with pytest.raises(ValueError, match="has seeds"):
        compare({"rule": np.zeros((3, 5))}, "rule")
    with pytest.raises(ValueError, match="play them on the same"):
        compare({"rule": np.arange(5.0), "other": np.zeros((3, 4))}, "rule")
