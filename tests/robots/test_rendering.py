import gymnasium
import mujoco
import numpy as np
import pytest

from inbounds.robots import Camera, RobotRenderer, record

ROBOTS = ["Hopper", "Walker2d", "Ant", "HalfCheetah", "Humanoid", "Swimmer"]


def made(name: str, **kwargs) -> gymnasium.Env:
    env = gymnasium.make(f"{name}-v5", **kwargs)
    env.reset(seed=0)
    return env


def robot_pixels(env: gymnasium.Env) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns where the frame changes when the robot is made invisible."""
    with RobotRenderer(env, width=160, height=120) as renderer:
        seen = renderer.frame().astype(int)
        renderer._model.geom_rgba[renderer._model.geom_bodyid > 0, 3] = 0
        renderer._model.geom_matid[renderer._model.geom_bodyid > 0] = -1
        empty = renderer.frame().astype(int)
    return np.nonzero(np.abs(seen - empty).sum(axis=2) > 30)


@pytest.mark.parametrize("name", ROBOTS)
def test_the_robot_stays_in_the_picture(name):
    env = made(name)
    data = env.unwrapped.data
    for x in (0.0, 37.0, -5.0):
        data.qpos[0] = x
        rows, columns = robot_pixels(env)
        assert rows.size > 200  # it is there, and not a speck
        assert rows.min() > 0
        assert rows.max() < 119
        assert columns.min() > 0
        assert columns.max() < 159


def test_a_high_jump_stays_in_the_picture():
    env = made("HalfCheetah")
    env.unwrapped.data.qpos[1] += 4.0
    rows, _ = robot_pixels(env)
    assert rows.size > 200
    assert rows.min() > 0


def test_drawing_changes_nothing_in_the_environment():
    env, untouched = made("HalfCheetah"), made("HalfCheetah")
    action = np.full(6, 0.3, np.float32)
    with RobotRenderer(env) as renderer:
        for _ in range(5):
            renderer.frame()
            np.testing.assert_array_equal(env.step(action)[0], untouched.step(action)[0])
    assert env.unwrapped.model.vis.quality.shadowsize == untouched.unwrapped.model.vis.quality.shadowsize
    np.testing.assert_array_equal(env.unwrapped.model.tex_data, untouched.unwrapped.model.tex_data)
    np.testing.assert_array_equal(
        env.unwrapped.model.mat_reflectance, untouched.unwrapped.model.mat_reflectance
    )


def test_the_frame_shows_the_present_state_and_is_a_new_array():
    env = made("HalfCheetah")
    with RobotRenderer(env) as renderer:
        first = renderer.frame()
        kept = first.copy()
        np.testing.assert_array_equal(renderer.frame(), first)  # the same state, the same picture
        env.unwrapped.data.qpos[2] += 1.0  # written, not yet propagated by mj_forward
        assert (renderer.frame() != first).any()
    np.testing.assert_array_equal(first, kept)


def test_a_model_without_a_sky_gets_a_light_one():
    with RobotRenderer(made("InvertedPendulum")) as renderer:
        frame = renderer.frame()
    sky = frame[0, 0]
    assert (sky > 200).all()
    share = (frame == sky).all(axis=2).mean()
    assert 0.5 < share < 0.99  # the cart, the pole and the rail are seen before it
    assert not (frame == 0).all(axis=2).any()


def test_a_model_with_a_sky_keeps_it():
    with RobotRenderer(made("Hopper")) as renderer:
        assert (renderer.frame()[0, 0] < 200).any()


def test_the_slow_options_are_off():
    with RobotRenderer(made("Ant")) as renderer:
        assert renderer._model.vis.quality.shadowsize == 0
        assert renderer._model.vis.quality.offsamples == 0
        assert not renderer._model.mat_reflectance.any()


def test_each_robot_of_a_vector_environment():
    envs = gymnasium.vector.SyncVectorEnv([lambda: gymnasium.make("Hopper-v5")] * 2)
    envs.reset(seed=0)
    envs.envs[1].unwrapped.data.qpos[2] = 0.5
    frames = []
    for index in (0, 1):
        with RobotRenderer(envs, index=index) as renderer:
            frames.append(renderer.frame())
    assert (frames[0] != frames[1]).any()
    with pytest.raises(IndexError, match="0 to 1"):
        RobotRenderer(envs, index=2)
    with RobotRenderer(envs) as renderer:
        for index in (-1, 2):
            with pytest.raises(IndexError, match="0 to 1"):
                renderer.frame(index)


def test_an_environment_without_mujoco_is_refused():
    with pytest.raises(TypeError, match=r"gymnasium\.make"):
        RobotRenderer(gymnasium.make("Pendulum-v1"))


@pytest.mark.parametrize("wrong", [{"seconds": np.nan}, {"seconds": -1.0}, {"max_fps": 0.0}, {"width": 0}])
def test_a_film_of_no_length_or_size_is_refused(wrong):
    env = gymnasium.make("Hopper-v5")
    with pytest.raises(ValueError, match="above zero"):
        record(env, lambda obs: env.action_space.low, **{"seconds": 1.0} | wrong)


def test_the_camera_obeys():
    env = made("HalfCheetah")
    frames = []
    for camera in (Camera(), Camera(azimuth=180.0), Camera(elevation=-80.0), Camera(distance=9.0)):
        with RobotRenderer(env, camera=camera) as renderer:
            frames.append(renderer.frame())
    for other in frames[1:]:
        assert (frames[0] != other).mean() > 0.05


@pytest.mark.parametrize(
    ("name", "stride", "fps"), [("Hopper", 5, 25.0), ("HalfCheetah", 1, 20.0), ("Humanoid", 3, 22.22)]
)
def test_a_film_runs_in_real_time(name, stride, fps):
    env = made(name)
    still = np.zeros(env.action_space.shape, np.float32)
    film = record(env, lambda obs: still, seconds=0.4, width=64, height=48)
    assert film.fps == pytest.approx(fps, abs=0.01)
    assert len(film.frames) == round(0.4 * film.fps)
    # the last frame is drawn from the state after (T - 1)·stride steps
    env.reset(seed=0)
    for _ in range((len(film.frames) - 1) * stride):
        env.step(still)
    with RobotRenderer(env, width=64, height=48) as renderer:
        np.testing.assert_array_equal(renderer.frame(), film.frames[-1])


def test_steps_faster_than_the_frame_rate_are_left_out():
    still = np.zeros(6, np.float32)
    every = record(made("HalfCheetah"), lambda obs: still, seconds=0.4, width=64, height=48)
    second = record(made("HalfCheetah"), lambda obs: still, seconds=0.4, width=64, height=48, max_fps=10)
    assert (every.fps, second.fps) == (20, 10)
    np.testing.assert_array_equal(second.frames, every.frames[::2])


def test_a_film_of_one_robot_of_many_is_that_of_the_robot_alone():
    envs = gymnasium.vector.SyncVectorEnv([lambda: gymnasium.make("HalfCheetah-v5")] * 2)
    actions = np.stack([np.full(6, 0.5), np.full(6, -0.5)]).astype(np.float32)
    second = record(envs, lambda obs: actions, seconds=0.4, seed=3, index=1, width=64, height=48)
    alone = record(made("HalfCheetah"), lambda obs: actions[1], seconds=0.4, seed=4, width=64, height=48)
    np.testing.assert_array_equal(second.frames, alone.frames)
    assert second.total_reward == alone.total_reward


@pytest.mark.parametrize("stride", [1, 2])
def test_the_reward_of_a_film_is_that_of_its_steps(stride):
    """Also of those that the last frame stands for and does not show."""
    env = made("HalfCheetah")
    action = np.full(6, 0.5, np.float32)
    film = record(env, lambda obs: action, seconds=0.5, seed=3, width=64, height=48, max_fps=20 / stride)
    env.reset(seed=3)
    assert len(film.frames) == 10 // stride
    assert film.total_reward == sum(float(env.step(action)[1]) for _ in range(len(film.frames) * stride))


def test_a_film_goes_on_after_the_end_of_an_episode():
    env = made("Hopper")
    rng = np.random.default_rng(0)
    film = record(env, lambda obs: rng.uniform(-1, 1, 3), seconds=2.0, width=64, height=48)
    assert len(film.frames) == 50


def test_mujoco_needs_no_log_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with RobotRenderer(made("HalfCheetah")) as renderer:
        renderer.frame()
    assert not list(tmp_path.iterdir())
    assert mujoco.get_mju_user_warning() is not None
