"""Pictures of a robot, drawn off screen by a camera that travels with it.

Software rendering spends nearly all of its time on shadows, multisampling and the mirrored floor. Without these
three a frame of 320 × 240 pixels takes milliseconds instead of tens of them, and the robot's motion, which is what
a frame is for, looks the same. The renderer works on a copy of the model and on data of its own: drawing
never changes a simulation.
"""

import copy
import math
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Self

import mujoco
import numpy as np
from numpy.typing import NDArray

from inbounds import headless
from inbounds.robots import messages

messages.install_handler()

Frame = NDArray[np.uint8]  # [height, width, 3]
_STATE = mujoco.mjtState.mjSTATE_INTEGRATION
_SKY = 236, 240, 245  # RGB, for a model that has no sky of its own


@dataclass(frozen=True)
class Camera:
    """Where the tracking camera stands, seen from the robot.

    Example:
        >>> Camera(azimuth=135.0).elevation
        -15.0
    """

    azimuth: float = 90.0
    """Direction of view about the vertical [degrees]; at 90 a robot that runs forwards moves to the right."""
    elevation: float = -15.0
    """Direction of view above the horizontal [degrees]; -90 looks straight down."""
    distance: float | None = None
    """From the camera to the robot's centre of mass [m]; None: as near as shows the whole robot."""

    def __post_init__(self) -> None:
        if self.distance is not None and not self.distance > 0:
            raise ValueError(f"a camera's distance must be positive, or None, got {self.distance}")


@dataclass(frozen=True)
class Film:
    """Frames and the rate at which they show real time.

    Attributes:
        frames: `[T, height, width, 3]`, 8-bit RGB.
        fps: frames per second of simulated time.
        total_reward: sum of the rewards collected while the film was made.

    Made by `record`, which has an example.
    """

    frames: Frame
    fps: float
    total_reward: float


class RobotRenderer:
    """Draws one robot of an environment, as often as asked, from the state it is in.

    Args:
        env: a Gymnasium MuJoCo environment (wrapped or not), a `SyncVectorEnv` of such, or one of this
            package's vector environments.
        index: which robot of a vector environment.
        width: of the frame [pixels].
        height: of the frame [pixels].
        camera: where the tracking camera stands; by default at the side, and above for a flat robot.

    Raises:
        RuntimeError: there is no OpenGL to draw with, or not so many pixels; the message names the fix.
        TypeError: the environment has no MuJoCo simulation that can be reached.
        IndexError: there is no robot of that index.

    Example:
        >>> import gymnasium
        >>> env = gymnasium.make("Swimmer-v5")
        >>> _ = env.reset(seed=0)
        >>> with RobotRenderer(env, width=96, height=64) as renderer:
        ...     renderer.frame().shape
        (64, 96, 3)
    """

    def __init__(
        self, env: Any, *, index: int = 0, width: int = 320, height: int = 240, camera: Camera | None = None
    ) -> None:
        headless.require_backend()
        self._index, self._count = index, _count(env)
        model, self._get_data = _simulation(env, index)
        self._model = _quick_to_draw(model, width, height)
        self._data = mujoco.MjData(self._model)
        self._state = np.empty(mujoco.mj_stateSize(self._model, _STATE))
        try:
            self._renderer = mujoco.Renderer(self._model, height, width)
        except Exception as error:  # each backend has exceptions of its own
            if "framebuffer" in str(error).lower():
                raise RuntimeError(
                    f"OpenGL cannot draw {width} × {height} pixels here ({error}): choose a smaller width and height"
                ) from error
            raise RuntimeError(
                f"OpenGL could not be started ({error}). Without a display, set MUJOCO_GL=egl before Python starts; "
                f"on Debian or Ubuntu: {headless.PACKAGES_HINT}"
            ) from error
        self._centre, self._radius, height_range = _extent(self._model)
        is_flat = height_range < 0.1 * self._radius  # as Swimmer is: seen from above
        self._view = self._make_view(camera or Camera(elevation=-40.0 if is_flat else -15.0))
        self._has_sky = bool(np.any(self._model.tex_type == mujoco.mjtTexture.mjTEXTURE_SKYBOX))

    def frame(self, index: int | None = None) -> Frame:
        """Return the robot as it stands now, `[height, width, 3]`, a new array.

        Args:
            index: which robot of a vector environment; by default the renderer's own.

        Raises:
            IndexError: there is no robot of that index.
        """
        index = self._index if index is None else index
        _require_robot(index, self._count)
        data = self._get_data(index)
        mujoco.mj_getState(self._model, data, self._state, _STATE)
        mujoco.mj_setState(self._model, self._data, self._state, _STATE)
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
        mujoco.mj_camlight(self._model, self._data)
        self._look_at(self._data.subtree_com[0])
        self._renderer.update_scene(self._data, self._view)
        frame = self._renderer.render()
        if not self._has_sky:  # MuJoCo leaves black what nothing covers
            frame[~frame.any(axis=2)] = _SKY
        return frame

    def close(self) -> None:
        """Free the OpenGL context; further frames are not possible."""
        self._renderer.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _make_view(self, camera: Camera) -> mujoco.MjvCamera:
        view = mujoco.MjvCamera()
        view.type = mujoco.mjtCamera.mjCAMERA_FREE
        view.azimuth, view.elevation = camera.azimuth, camera.elevation
        half_field = math.radians(self._model.vis.global_.fovy) / 2
        near = 1.1 * self._radius / math.sin(half_field)
        view.distance = near if camera.distance is None else camera.distance
        return view

    def _look_at(self, centre: NDArray[np.float64]) -> None:
        """Follow the ground track exactly, and the height only when a jump would leave the picture."""
        rise = centre[2] - self._centre[2]
        slack = 0.4 * self._radius
        follow = math.copysign(max(abs(rise) - slack, 0.0), rise)
        self._view.lookat[:] = centre[0], centre[1], self._centre[2] + follow


def record(
    env: Any,
    policy: Callable[[NDArray[Any]], NDArray[Any]],
    *,
    seconds: float = 4.0,
    seed: int | None = 0,
    index: int = 0,
    width: int = 320,
    height: int = 240,
    max_fps: float = 30.0,
    camera: Camera | None = None,
) -> Film:
    """Reset an environment, let a policy act in it, and film one robot in real time.

    An episode that ends is followed by the next. Steps faster than `max_fps` are filmed at every second, third, …

    Args:
        env: as for `RobotRenderer`.
        policy: from observations to actions, both as the environment has them: `[O] → [A]` for a
            single environment, `[N, O] → [N, A]` for a vector environment.
        seconds: simulated time to film.
        seed: for the environment's reset; None continues its generator.
        index: which robot of a vector environment.
        width: of the frame [pixels].
        height: of the frame [pixels].
        max_fps: upper limit of the frame rate.
        camera: where the tracking camera stands.

    Returns:
        The film; its first frame shows the state after the reset.

    Raises:
        RuntimeError: there is no OpenGL to draw with; the message names the fix.
        TypeError: the environment has no MuJoCo simulation.
        IndexError: there is no robot of that index.
        ValueError: a film of no length or no size.
        MemoryError: a film that is too long or too large.

    Example:
        >>> import gymnasium
        >>> env = gymnasium.make("HalfCheetah-v5")
        >>> film = record(env, lambda obs: env.action_space.low, seconds=0.5, width=96, height=64)
        >>> film.frames.shape, film.fps
        ((10, 64, 96, 3), 20.0)
    """
    _simulation(env, index)  # says what is wrong before anything else fails for lack of it
    if not (0 < seconds < math.inf and max_fps > 0 and width > 0 and height > 0):
        raise ValueError(
            f"a film has seconds, max_fps, width and height above zero, got {seconds}, {max_fps}, {width}, {height}"
        )
    is_vector = hasattr(env, "num_envs")
    step_time = _step_time(env)
    stride = max(1, math.ceil(1 / (max_fps * step_time) - 1e-9))
    num_frames = max(1, round(seconds / (stride * step_time)))
    obs, _ = env.reset(seed=seed)
    total_reward = 0.0
    with RobotRenderer(env, index=index, width=width, height=height, camera=camera) as renderer:
        try:
            frames = np.empty((num_frames, height, width, 3), np.uint8)
        except ValueError as error:  # NumPy's, where no address is so long
            raise MemoryError(f"{seconds:g} s of {width} × {height} pixels: {error}") from error
        for step in range(num_frames * stride):
            if step % stride == 0:
                frames[step // stride] = renderer.frame()
            obs, reward, terminated, truncated, _ = env.step(policy(obs))
            total_reward += float(reward[index] if is_vector else reward)
            if not is_vector and (terminated or truncated):
                obs, _ = env.reset()
    return Film(frames, 1 / (stride * step_time), total_reward)


def is_drawable(env: Any) -> bool:
    """Say whether an environment has a MuJoCo simulation that `record` can film.

    Example:
        >>> import gymnasium
        >>> is_drawable(gymnasium.make("Hopper-v5")), is_drawable(gymnasium.make("Pendulum-v1"))
        (True, False)
    """
    try:
        _simulation(env, 0)
    except TypeError:
        return False
    return True


def _simulation(env: Any, index: int) -> tuple[mujoco.MjModel, Callable[[int], mujoco.MjData]]:
    """Return an environment's model, and a function from a robot's index to its present data."""
    _require_robot(index, _count(env))
    inner = env.unwrapped
    if hasattr(inner, "get_data"):  # this package's vector environments
        return inner.model, inner.get_data
    singles = [single.unwrapped for single in getattr(inner, "envs", [inner])]  # SyncVectorEnv has several
    if not all(isinstance(getattr(single, "model", None), mujoco.MjModel) for single in singles):
        raise TypeError(
            f"{type(singles[0]).__name__} gives no access to a MuJoCo simulation: only MuJoCo's robots can be drawn, "
            "made by gymnasium.make(...), SyncVectorEnv or inbounds.robots.make(...)"
        )
    return singles[index].model, lambda i: singles[i].data


def _count(env: Any) -> int:
    return int(getattr(env, "num_envs", 1))


def _require_robot(index: int, count: int) -> None:
    if not 0 <= index < count:
        raise IndexError(f"index {index} is out of range: this environment has robots 0 to {count - 1}")


def _step_time(env: Any) -> float:
    """Return the simulated time of one environment step [s]."""
    inner = env.unwrapped
    return float(inner.envs[0].unwrapped.dt if hasattr(inner, "envs") else inner.dt)


def _quick_to_draw(model: mujoco.MjModel, width: int, height: int) -> mujoco.MjModel:
    """Return a copy of the model without what makes software rendering slow and videos large."""
    model = copy.copy(model)
    model.vis.quality.shadowsize = 0
    model.vis.quality.offsamples = 0
    model.mat_reflectance[:] = 0
    for texture in np.flatnonzero(model.tex_type == mujoco.mjtTexture.mjTEXTURE_2D):
        start = model.tex_adr[texture]
        size = model.tex_width[texture] * model.tex_height[texture] * model.tex_nchannel[texture]
        texels = model.tex_data[
            start : start + size
        ]  # a view: the floor's black and white, made two calm greys
        texels[:] = 130 + texels // 4
    model.vis.global_.offwidth, model.vis.global_.offheight = width, height
    return model


def _extent(model: mujoco.MjModel) -> tuple[NDArray[np.float64], float, float]:
    """Return centre of mass, radius and range of heights [m] of the robot in its reference pose."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    centre = data.subtree_com[0].copy()
    own = model.geom_bodyid > 0  # all but the floor
    reach = np.linalg.norm(data.geom_xpos[own] - centre, axis=1) + model.geom_rbound[own]
    return centre, float(reach.max()), float(np.ptp(data.geom_xpos[own, 2]))
