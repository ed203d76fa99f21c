"""What the batched robots promise beyond Gymnasium's numbers."""

import pickle
import re
import subprocess
import sys
import warnings

import gymnasium
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from inbounds.robots import TASKS, MujocoWarning, RobotRenderer, RobotVectorEnv, make, record, registration


def actions_for(envs: RobotVectorEnv, steps: int, seed: int = 0) -> np.ndarray:
    """Actions of unit spread relative to the box, ``[steps, N, A]``."""
    noise = np.random.default_rng(seed).standard_normal((steps, *envs.action_space.shape))
    return (envs.single_action_space.high * noise).astype(np.float32)


def play(envs: RobotVectorEnv, actions: np.ndarray) -> list[tuple]:
    return [envs.step(action)[:4] for action in actions]


def assert_equal_plays(first: list[tuple], second: list[tuple]) -> None:
    for one, other in zip(first, second, strict=True):
        for a, b in zip(one, other, strict=True):
            np.testing.assert_array_equal(a, b)


# ── State ────────────────────────────────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize("name", TASKS)
def test_a_saved_state_goes_on_bit_for_bit(name):
    envs = make(name, 2, max_episode_steps=50)
    envs.reset(seed=0)
    actions = actions_for(envs, 90)
    play(envs, actions[:30])
    state = envs.get_state()
    uninterrupted = play(envs, actions[30:])
    assert any(terminated.any() or truncated.any() for _, _, terminated, truncated in uninterrupted)

    resumed = make(name, 2, max_episode_steps=50)  # as after a restart of the process
    obs = resumed.set_state(pickle.loads(pickle.dumps(state)))
    np.testing.assert_array_equal(obs, state["obs"])
    assert_equal_plays(play(resumed, actions[30:]), uninterrupted)
    assert resumed.np_random_seed == envs.np_random_seed

    envs.set_state(state)  # and the same environment, rewound
    assert_equal_plays(play(envs, actions[30:]), uninterrupted)


def test_a_saved_state_shares_no_memory():
    envs = make("Hopper-v5", 2)
    envs.reset(seed=0)
    state = envs.get_state()
    kept = pickle.loads(pickle.dumps(state))
    play(envs, actions_for(envs, 40))
    for key in ("physics", "position", "elapsed", "obs"):
        np.testing.assert_array_equal(state[key], kept[key])
    assert state["generators"] == kept["generators"]
    obs = envs.set_state(state)
    obs[:] = 0
    play(envs, actions_for(envs, 5))
    np.testing.assert_array_equal(state["obs"], kept["obs"])


def test_a_state_that_does_not_fit_is_refused():
    hopper = make("Hopper-v5", 2)
    hopper.reset(seed=0)
    for other in (make("Hopper-v5", 3), make("Swimmer-v5", 2)):
        with pytest.raises(ValueError, match=r"2 × Hopper-v5.*same name and num_envs"):
            other.set_state(hopper.get_state())
    before, cut = hopper.get_state(), hopper.get_state()
    cut["physics"] += 1
    cut["generators"].pop()
    with pytest.raises(ValueError, match="make it with the same name and num_envs"):
        hopper.set_state(cut)
    np.testing.assert_array_equal(hopper.get_state()["physics"], before["physics"])


# ── Robots do not touch each other ───────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize("name", ["Hopper-v5", "Ant-v5"])
def test_a_robot_does_not_depend_on_the_others_nor_on_threads(name):
    together, alone = make(name, 4, num_threads=2), make(name, 1)
    together.reset(seed=[1, 2, 3, 4])
    alone.reset(seed=[3])
    actions = actions_for(together, 80)
    for many, one in zip(play(together, actions), play(alone, actions[:, 2:3]), strict=True):
        for a, b in zip(many, one, strict=True):
            np.testing.assert_array_equal(a[2:3], b)


def test_what_is_returned_is_the_callers_own():
    envs, control = make("Hopper-v5", 2), make("Hopper-v5", 2)
    obs, _ = envs.reset(seed=0)
    control.reset(seed=0)
    obs[:] = 77.0
    for action in actions_for(envs, 40):
        returned, expected = envs.step(action), control.step(action)
        np.testing.assert_array_equal(returned[0], expected[0])
        kept = [array.copy() for array in expected[:4]]
        for array in returned[:4]:
            array[:] = 1
        np.testing.assert_array_equal(envs.get_state()["obs"], expected[0])
        for key, values in returned[4].items():
            if not key.startswith("_") and isinstance(values, np.ndarray):
                values[:] = 0
        for array, before in zip(expected[:4], kept, strict=True):
            np.testing.assert_array_equal(array, before)
    mask = np.array([True, False])
    _, info = envs.reset(options={"reset_mask": mask})
    mask[:] = False
    assert info["_x_position"].tolist() == [True, False]


def test_a_past_observation_stays_as_it_was():
    envs = make("Ant-v5", 2)
    past, _ = envs.reset(seed=0)
    for action in actions_for(envs, 20):
        kept = past.copy()
        present = envs.step(action)[0]
        np.testing.assert_array_equal(past, kept)
        past = present


# ── Episodes ─────────────────────────────────────────────────────────────────────────────────────────────────


def test_truncation_at_the_limit():
    envs = make("HalfCheetah-v5", 2, max_episode_steps=5)
    envs.reset(seed=0)
    zeros = np.zeros((2, 6), np.float32)
    flags = [envs.step(zeros)[3].tolist() for _ in range(10)]
    assert flags == ([[False, False]] * 4 + [[True, True]]) * 2


def test_robots_reset_at_different_times_are_truncated_at_different_times():
    envs = make("HalfCheetah-v5", 2, max_episode_steps=6)
    envs.reset(seed=0)
    zeros = np.zeros((2, 6), np.float32)
    for _ in range(4):
        envs.step(zeros)
    envs.reset(options={"reset_mask": np.array([True, False])})
    assert [envs.step(zeros)[3].tolist() for _ in range(6)] == [
        [False, False], [False, True], [False, False], [False, False], [False, False], [True, False],
    ]  # fmt: skip


def test_falling_at_the_limit_is_both():
    envs = make("Hopper-v5", 1, max_episode_steps=1000)
    envs.reset(seed=0)
    ends = [i for i, (_, _, terminated, _) in enumerate(play(envs, actions_for(envs, 200))) if terminated[0]]
    envs = make("Hopper-v5", 1, max_episode_steps=ends[0] + 1)
    envs.reset(seed=0)
    *_, (_, _, terminated, truncated) = play(envs, actions_for(envs, 200)[: ends[0] + 1])
    assert (terminated[0], truncated[0]) == (True, True)


def test_the_final_observation_is_that_of_the_old_episode():
    envs = make("HalfCheetah-v5", 2, max_episode_steps=3)
    envs.reset(seed=0)
    zeros = np.zeros((2, 6), np.float32)
    for _ in range(3):
        obs, *_, info = envs.step(zeros)
    assert info["_final_obs"].all()
    for robot in range(2):
        assert np.abs(info["final_obs"][robot] - obs[robot]).max() > 0.05
    assert info["final_info"]["x_position"].tolist() != info["x_position"].tolist()
    assert "reward_forward" not in info
    assert info["final_info"]["_reward_forward"].all()


# ── Actions ──────────────────────────────────────────────────────────────────────────────────────────────────


@settings(deadline=None, max_examples=20)
@given(
    name=st.sampled_from(["HalfCheetah-v5", "Swimmer-v5", "Hopper-v5"]),
    data=st.data(),
)
def test_clip_is_raw_with_the_clipped_action(name, data):
    clip, raw = make(name, 2), make(name, 2, action_mode="raw")
    clip.reset(seed=1)
    raw.reset(seed=1)
    values = st.floats(-9, 9, width=32) | st.sampled_from([-np.inf, np.inf])
    action = data.draw(hnp.arrays(np.float32, clip.action_space.shape, elements=values))
    assert_equal_plays([clip.step(action)[:4]], [raw.step(np.clip(action, -1, 1))[:4]])


def test_raw_actions_cost_more_and_move_the_same():
    clip, raw = make("HalfCheetah-v5", 1), make("HalfCheetah-v5", 1, action_mode="raw")
    clip.reset(seed=0)
    raw.reset(seed=0)
    action = np.full((1, 6), 2.0, np.float32)
    (obs, reward, *_, info), (raw_obs, raw_reward, *_, raw_info) = clip.step(action), raw.step(action)
    np.testing.assert_array_equal(obs, raw_obs)
    assert info["reward_ctrl"][0] == pytest.approx(-0.1 * 6 * 1)
    assert raw_info["reward_ctrl"][0] == pytest.approx(-0.1 * 6 * 4)
    assert reward[0] - raw_reward[0] == pytest.approx(0.1 * 6 * 3)


@pytest.mark.parametrize("name", TASKS)
def test_the_reward_is_the_sum_of_its_terms(name):
    envs = make(name, 2)
    envs.reset(seed=0)
    for action in actions_for(envs, 30):
        _, reward, _, _, info = envs.step(action)
        info = info.get("final_info", info)
        terms = sum(info[key] for key in info if key.startswith("reward_"))
        known = info["_reward_forward"]
        np.testing.assert_allclose(terms[known], reward[known], rtol=1e-6)


def test_integer_actions_are_accepted():
    envs, control = make("HalfCheetah-v5", 1), make("HalfCheetah-v5", 1)
    envs.reset(seed=0)
    control.reset(seed=0)
    ones = np.ones((1, 6), int)
    assert_equal_plays([envs.step(ones)[:4]], [control.step(ones.astype(np.float32))[:4]])


def test_actions_that_are_not_finite_are_named():
    envs = make("HalfCheetah-v5", 4)
    envs.reset(seed=0)
    action = np.zeros((4, 6), np.float32)
    action[[1, 3], 2] = np.nan
    state = envs.get_state()
    with pytest.raises(ValueError, match=r"robots \[1, 3\] are not finite"):
        envs.step(action)
    np.testing.assert_array_equal(envs.get_state()["physics"], state["physics"])  # nothing has moved
    raw = make("HalfCheetah-v5", 1, action_mode="raw")
    raw.reset(seed=0)
    with pytest.raises(ValueError, match="not finite"):
        raw.step(np.full((1, 6), np.inf))
    _, reward, *_ = envs.step(np.full((4, 6), np.inf))  # clipped, and paid as clipped
    assert np.isfinite(reward).all()


# ── Errors ───────────────────────────────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize(
    ("kwargs", "message"),
    [
        ({"name": "HalfCheetah-v4"}, "there are Hopper-v5, Walker2d-v5"),
        ({"num_envs": 0}, "num_envs must be a whole number, at least 1"),
        ({"max_episode_steps": 0}, "max_episode_steps must be a whole number, at least 1"),
        ({"max_episode_steps": 2.5}, "max_episode_steps must be a whole number"),
        ({"num_threads": 0}, "num_threads must be a whole number, at least 1"),
        ({"action_mode": "squash"}, "'clip' or 'raw'"),
        ({"render_mode": "human"}, "None or 'rgb_array'"),
    ],
)
def test_bad_arguments(kwargs, message):
    with pytest.raises(ValueError, match=message):
        make(**({"name": "Hopper-v5"} | kwargs))


def test_bad_calls():
    envs = make("Hopper-v5", 2)
    mask = np.array([True, False])
    with pytest.raises(gymnasium.error.ResetNeeded):
        envs.step(np.zeros((2, 3), np.float32))
    with pytest.raises(gymnasium.error.ResetNeeded):
        envs.get_state()
    with pytest.raises(gymnasium.error.ResetNeeded, match="all robots"):
        envs.reset(options={"reset_mask": mask})
    with pytest.raises(ValueError, match="one seed for each of the 2"):
        envs.reset(seed=[1, 2, 3])
    envs.reset(seed=0)
    with pytest.raises(ValueError, match=r"shape \(2, 3\), got \(3,\)"):
        envs.step(np.zeros(3, np.float32))
    seeds = envs.np_random_seed
    with pytest.raises(gymnasium.error.Error, match="Seed must be"):
        envs.reset(seed=[5, -1])
    assert envs.np_random_seed == seeds
    for bad in ([True], np.array([1, 0]), np.array([False, False])):
        with pytest.raises(ValueError, match="2 booleans, at least one"):
            envs.reset(options={"reset_mask": bad})


def unstable() -> RobotVectorEnv:
    envs = make("Hopper-v5", 2)
    envs.reset(seed=0)
    state = envs.get_state()
    state["physics"][1, 7:13] = 1e20  # the velocities of robot 1
    envs.set_state(state)
    return envs


def test_an_unstable_simulation_warns():
    with pytest.warns(MujocoWarning, match="unstable"):
        unstable().step(np.zeros((2, 3), np.float32))


def test_an_unstable_simulation_raises_where_warnings_are_errors():
    envs = unstable()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(MujocoWarning, match="unstable"):
            envs.step(np.zeros((2, 3), np.float32))
    state = envs.get_state()  # of a whole step
    assert state["elapsed"].tolist() == [1, 1]
    np.testing.assert_array_equal(state["obs"][0, 5:], np.clip(envs.get_data(0).qvel, -10, 10))


# ── Pictures ─────────────────────────────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize("name", ["HalfCheetah-v5", "Ant-v5"])
def test_any_robot_can_be_drawn(name):
    envs = make(name, 3, render_mode="rgb_array")
    envs.reset(seed=0)
    frames = envs.render()
    assert [frame.shape for frame in frames] == [(240, 320, 3)] * 3
    assert (frames[0] != frames[2]).any()
    assert min(frame.mean() for frame in frames) > 60  # by their own light: without it, less
    with RobotRenderer(envs, index=2) as renderer:
        np.testing.assert_array_equal(renderer.frame(), frames[2])
        np.testing.assert_array_equal(renderer.frame(0), frames[0])
    single = gymnasium.make(name)
    single.reset(seed=2)
    with RobotRenderer(single) as renderer:  # Gymnasium's robot in the same state gives the same picture
        np.testing.assert_array_equal(renderer.frame(), frames[2])
    envs.close()
    np.testing.assert_array_equal(envs.render()[2], frames[2])  # opened anew
    envs.close()
    assert make(name, 1).render() is None


def test_a_film_of_one_robot_of_many():
    envs = make("HalfCheetah-v5", 2)
    film = record(
        envs, lambda obs: np.zeros((len(obs), 6), np.float32), seconds=0.3, index=1, width=64, height=48
    )
    assert film.frames.shape == (6, 48, 64, 3)
    assert film.fps == pytest.approx(20)


# ── Registration and documentation ───────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize("name", TASKS)
def test_gymnasium_can_make_them(name):
    envs = gymnasium.make_vec(f"inbounds/{name}", num_envs=2, action_mode="raw")
    assert isinstance(envs, RobotVectorEnv)
    assert (envs.num_envs, envs.action_mode, envs.max_episode_steps) == (2, "raw", 1000)
    assert envs.reset(seed=0)[0] in envs.observation_space
    assert make(f"inbounds/{name}").name == name
    again = gymnasium.make_vec(envs.spec)  # a specification makes the same environment again
    assert (again.num_envs, again.action_mode) == (2, "raw")


def test_the_id_can_name_the_module_to_import():
    code = "import gymnasium; print(gymnasium.make_vec('inbounds.robots.vector_env:inbounds/Swimmer-v5', num_envs=3))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "RobotVectorEnv(inbounds/Swimmer-v5, num_envs=3)"
    assert done.stderr == ""


def test_the_room_knows_its_ids():
    code = "import inbounds.robots, gymnasium; print(gymnasium.make_vec('inbounds/Swimmer-v5', num_envs=3))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "RobotVectorEnv(inbounds/Swimmer-v5, num_envs=3)"


def test_one_by_itself_is_told_what_to_call():
    with pytest.raises(
        gymnasium.error.Error, match=r'make_vec\("inbounds/Hopper-v5", num_envs=10\).*make\("Hopper-v5"\)'
    ):
        gymnasium.make("inbounds/Hopper-v5")
    spec = gymnasium.spec("inbounds/Hopper-v5")
    assert gymnasium.envs.registration.EnvSpec.from_json(spec.to_json()) == spec


def test_registering_twice_does_no_harm():
    registration.register()
    assert set(registration.TASK_NAMES) == set(TASKS)


@pytest.mark.parametrize("name", TASKS)
def test_the_tables_cover_every_action_and_observation(name):
    envs = make(name)
    for kind, size in (("action", envs.action_space.shape[1]), ("obs", envs.observation_space.shape[1])):
        covered: list[int] = []
        for first, last in re.findall(
            rf"^ *{kind} (\d+)(?:–(\d+))? ", TASKS[name].__doc__, flags=re.MULTILINE
        ):
            covered += range(int(first), int(last or first) + 1)
        assert covered == list(range(size))
    assert f"{envs.dt:g} s" in TASKS[name].__doc__


def test_seeds_may_be_numpys() -> None:
    envs = make("Swimmer-v5", 2)
    expected = envs.reset(seed=3)[0]
    assert np.array_equal(envs.reset(seed=np.int64(3))[0], expected)
    assert np.array_equal(envs.reset(seed=list(np.array([3, 4])))[0], expected)


@pytest.mark.parametrize("seed", ["12", [1.9, 2.9], [1, 2, 3], ["1", "2"], 5.0, np.array(3)])
def test_what_is_no_seed_is_refused(seed) -> None:
    with pytest.raises(ValueError, match="one seed for each of the 2 robots, or one integer; got"):
        make("Swimmer-v5", 2).reset(seed=seed)
