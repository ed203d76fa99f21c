"""The batched robots against Gymnasium's own, to the last bit.

The oracle is a ``SyncVectorEnv`` of Gymnasium's v5 environments that resets in the same step; what is compared is
everything that ``reset`` and ``step`` return, info included, with types and masks.
"""

import itertools

import gymnasium
import mujoco
import numpy as np
import pytest
from gymnasium.envs.mujoco.humanoid_v5 import mass_center
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from inbounds.robots import TASKS, RobotVectorEnv, make

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
@pytest.mark.parametrize(("name", "ends"), [("Hopper-v5", "terminated"), ("HalfCheetah-v5", "truncated")])
def test_a_second_episode_ends_as_the_first(name, ends):
    """An episode has 1000 steps, and a few dozen where the robot falls."""
    counts = run_beside(name, "raw", num_envs=2, steps=700 if name in FALLS else 2010)
    assert counts[ends] >= 2 * 2


def put(single: gymnasium.Env, robots: RobotVectorEnv, height: float, lean: float, speed: float) -> None:
    """Bring Gymnasium's robot, and the only one of the batch, into the same unusual state."""
    inner = single.unwrapped
    qpos, qvel = inner.init_qpos.copy(), np.full(inner.model.nv, speed)
    qpos[robots.task.hidden] = (
        height  # z, but the front link's heading for Swimmer and Half Cheetah's z offset
    )
    if robots.task.hidden == 1:
        qpos[2] = lean
    inner.set_state(qpos, qvel)
    state = robots.get_state()
    mujoco.mj_getState(inner.model, inner.data, state["physics"][0], mujoco.mjtState.mjSTATE_INTEGRATION)
    place = {"Ant-v5": inner.data.xpos[1], "Humanoid-v5": mass_center(inner.model, inner.data)}
    state["position"][0] = place.get(robots.name, inner.data.qpos)[: robots.task.hidden]
    robots.set_state(state)


HEIGHTS = (0.1, 0.21, 0.69, 0.71, 0.79, 0.81, 0.99, 1.01, 1.99, 2.01)
LEANS = (0.0, -0.19, 0.21, -0.99, 1.01)
SPEEDS = (0.0, 12.0, -150.0)  # beyond what is observed, beyond what is healthy


@pytest.mark.filterwarnings(
    "ignore::inbounds.robots.MujocoWarning"
)  # some go unstable: both reset them alike
@pytest.mark.parametrize("name", TASKS)
def test_unusual_states(name):
    """High, low, leaning and fast robots: the limits of health and of what is observed."""
    single, robots = gymnasium.make(name), make(name, 1)
    single.reset(seed=0)
    robots.reset(seed=0)
    action = np.zeros(single.action_space.shape, np.float32)
    healthy = 0
    for height, lean, speed in itertools.product(HEIGHTS, LEANS, SPEEDS):
        put(single, robots, height, lean, speed)
        expected, actual = single.step(action), robots.step(action[None])
        where = f"height {height}, lean {lean}, speed {speed}"
        info = actual[4].get("final_info", actual[4])
        obs = actual[4]["final_obs"] if actual[2][0] else actual[0]
        np.testing.assert_array_equal(obs[0], expected[0], err_msg=where)
        assert (actual[1][0], actual[2][0]) == expected[1:3], where
        for key, value in expected[4].items():
            np.testing.assert_array_equal(info[key][0], value, err_msg=where)
        healthy += not expected[2]
    assert 0 < healthy < 150 or name not in FALLS


LIMITS = [0.2, 0.7, 0.8, 1.0, 2.0, 100.0]
EDGES = [
    edge for x in LIMITS for y in (x, -x) for edge in (np.nextafter(y, -np.inf), y, np.nextafter(y, np.inf))
]


@pytest.mark.parametrize("name", sorted(FALLS))
def test_health_at_its_limits(name):
    single, robots = gymnasium.make(name).unwrapped, make(name, 1)
    health = set()
    for value in [*EDGES, 0.0, 1.3, np.nan, np.inf, -np.inf]:
        for index in range(single.model.nq + single.model.nv):
            state = np.concatenate((single.init_qpos, single.init_qvel))
            state[index] = value
            for qpos, qvel in (
                (robots.task.qpos[0], robots.task.qvel[0]),
                (single.data.qpos, single.data.qvel),
            ):
                qpos[:], qvel[:] = np.split(state, [single.model.nq])
            assert robots.task.is_healthy()[0] == single.is_healthy, f"{value} at {index}"
            health.add(bool(single.is_healthy))
    assert health == {True, False}


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
