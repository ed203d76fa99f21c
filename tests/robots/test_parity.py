"""The batched robots against Gymnasium's own, to the last bit.

The oracle is a ``SyncVectorEnv`` of Gymnasium's v5 environments that resets in the same step; what is compared is
everything that ``reset`` and ``step`` return, info included, with types and masks.
"""

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from inbounds.robots import TASKS, make

FALLS = {"Hopper-v5", "Walker2d-v5", "Ant-v5", "Humanoid-v5"}


def oracle(name: str, num_envs: int, action_mode: str = "clip", **kwargs) -> SyncVectorEnv:
    def single() -> gymnasium.Env:
        env = gymnasium.make(name, **kwargs)
        return gymnasium.wrappers.ClipAction(env) if action_mode == "clip" else env

    return SyncVectorEnv([single] * num_envs, autoreset_mode=AutoresetMode.SAME_STEP)


def assert_same(expected, actual, where: str) -> None:
    """Equal in structure, type and every bit."""
    if isinstance(expected, dict):
        assert expected.keys() == actual.keys(), where
        for key in expected:
            assert_same(expected[key], actual[key], f"{where}.{key}")
    elif expected.dtype == object:  # final_obs: an array for each robot whose episode ended, else None
        assert actual.dtype == object, where
        for one, other in zip(expected, actual, strict=True):
            assert (one is None) == (other is None), where
            if one is not None:
                assert_same(one, other, where)
    else:
        assert expected.dtype == actual.dtype, where
        np.testing.assert_array_equal(actual, expected, err_msg=where)


def run_beside(
    name: str, action_mode: str, num_envs: int, steps: int, dtype: type = np.float32
) -> dict[str, int]:
    """Let both act side by side with actions in and out of the box; count what happened."""
    expected, actual = oracle(name, num_envs, action_mode), make(name, num_envs, action_mode=action_mode)
    for one, other in zip(expected.reset(seed=7), actual.reset(seed=7), strict=True):
        assert_same(one, other, "reset")
    rng = np.random.default_rng(0)
    counts = {"terminated": 0, "truncated": 0, "outside": 0, "contacts": 0}
    num_contacts = actual._batch.bind("ncon")
    box = actual.single_action_space
    for step in range(steps):
        scale = box.high * (3.0 if step % 3 == 0 else 0.7)  # often outside the box, often well inside
        action = (scale * rng.standard_normal((num_envs, *box.shape))).astype(dtype)
        returned = expected.step(action), actual.step(action)
        for label, one, other in zip(
            ("obs", "reward", "terminated", "truncated", "info"), *returned, strict=True
        ):
            assert_same(one, other, f"{label} at step {step}")
        counts["terminated"] += int(returned[1][2].sum())
        counts["truncated"] += int(returned[1][3].sum())
        counts["outside"] += int((np.abs(action) > box.high).sum())
        counts["contacts"] += int(num_contacts.sum())
    return counts


@pytest.mark.parametrize("name", TASKS)
def test_clipped_actions(name):
    counts = run_beside(name, "clip", num_envs=2, steps=1010)
    assert counts["outside"] > 1000
    if name in FALLS:
        assert counts["terminated"] > 10
    else:
        assert counts["truncated"] == 2
    if name != "Swimmer-v5":  # it touches nothing
        assert counts["contacts"] > 100


@pytest.mark.parametrize("name", TASKS)
def test_raw_actions(name):
    assert run_beside(name, "raw", num_envs=1, steps=300)["outside"] > 100


@pytest.mark.parametrize("action_mode", ["clip", "raw"])
@pytest.mark.parametrize("name", ["Humanoid-v5", "Ant-v5", "HalfCheetah-v5"])
def test_actions_in_double_precision(name, action_mode):
    run_beside(name, action_mode, num_envs=3, steps=60, dtype=np.float64)


@pytest.mark.slow
@pytest.mark.parametrize("action_mode", ["clip", "raw"])
@pytest.mark.parametrize("name", TASKS)
def test_four_robots_for_two_episodes(name, action_mode):
    run_beside(name, action_mode, num_envs=4, steps=2100)


def test_one_robot_against_a_plain_environment():
    single, robots = gymnasium.make("HalfCheetah-v5"), make("HalfCheetah-v5", 3)
    obs, _ = robots.reset(seed=40)
    np.testing.assert_array_equal(obs[2], single.reset(seed=42)[0])
    action = np.linspace(-1, 1, 6, dtype=np.float32)
    for _ in range(1000):
        expected = single.step(action)
        obs, reward, terminated, truncated, info = robots.step(np.tile(action, (3, 1)))
        assert reward[2] == expected[1]
        assert (terminated[2], truncated[2]) == expected[2:4]
    np.testing.assert_array_equal(info["final_obs"][2], expected[0])
    np.testing.assert_array_equal(obs[2], single.reset()[0])  # the generator went on


@pytest.mark.parametrize("name", ["Hopper-v5", "Ant-v5"])
def test_seeds_and_partial_resets(name):
    expected, actual = oracle(name, 4), make(name, 4)
    action = np.full(actual.action_space.shape, 0.5, np.float32)
    middle = np.array([False, True, True, False])
    for seed, options in [
        (3, None),
        ([9, 1, 5, 1], None),
        (None, None),
        ([2, None, None, 8], None),
        (11, {"reset_mask": middle}),
        (None, {"reset_mask": middle}),
        ([None, 4, None, None], {"reset_mask": middle}),
    ]:
        # Gymnasium takes the mask out of the options, so each gets its own
        returned = [envs.reset(seed=seed, options=options and dict(options)) for envs in (expected, actual)]
        for one, other in zip(*returned, strict=True):
            assert_same(one, other, f"reset with {seed} and {options}")
        assert actual.np_random_seed == expected.np_random_seed
        for step in range(30):
            for one, other in zip(expected.step(action), actual.step(action), strict=True):
                assert_same(
                    np.asarray(one) if not isinstance(one, dict) else one, other, f"step {step} after {seed}"
                )


def test_equal_seeds_make_equal_robots():
    obs, _ = make("Hopper-v5", 3).reset(seed=[5, 6, 5])
    np.testing.assert_array_equal(obs[0], obs[2])
    assert (obs[0] != obs[1]).any()


def test_without_a_seed_robots_differ():
    obs, _ = make("Hopper-v5", 2).reset()
    assert (obs[0] != obs[1]).any()


@pytest.mark.parametrize("name", TASKS)
def test_spaces_and_times(name):
    expected, actual = gymnasium.make(name), make(name, 2)
    assert actual.single_action_space == expected.action_space
    assert actual.single_observation_space == expected.observation_space
    assert actual.dt == expected.unwrapped.dt
    assert actual.metadata["render_fps"] == expected.metadata["render_fps"]
    assert actual.metadata["autoreset_mode"] == AutoresetMode.SAME_STEP


def test_gymnasiums_own_wrappers_agree():
    counted = [
        gymnasium.wrappers.vector.RecordEpisodeStatistics(envs)
        for envs in (oracle("Hopper-v5", 2), make("Hopper-v5", 2))
    ]
    for envs in counted:
        envs.reset(seed=0)
    episodes = 0
    for _ in range(100):
        action = np.full((2, 3), 0.4, np.float32)
        infos = [envs.step(action)[4] for envs in counted]
        assert ("episode" in infos[0]) == ("episode" in infos[1])
        if "episode" in infos[0]:
            episodes += 1
            np.testing.assert_array_equal(infos[0]["episode"]["r"], infos[1]["episode"]["r"])
            np.testing.assert_array_equal(infos[0]["episode"]["l"], infos[1]["episode"]["l"])
    assert episodes
