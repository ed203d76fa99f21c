"""Many robots, one environment: Gymnasium's v5 tasks stepped by one `mujoco.batch.Batch`.

A robot whose episode ends is reset within the same step (`AutoresetMode.SAME_STEP`): the observation returned
is the first of the new episode, the last of the old one is in `info["final_obs"]`. Gymnasium's default, a reset
in the *next* step, would put a transition into every rollout in which the action has no effect.
"""

from collections.abc import Iterable, Sequence
from numbers import Integral
from typing import Any, Literal

import gymnasium
import mujoco
import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from mujoco.batch import Batch
from numpy.typing import NDArray

from inbounds.robots import messages, registration
from inbounds.robots.contact_tasks import Ant, Humanoid
from inbounds.robots.infos import Info, masked, only
from inbounds.robots.rendering import RobotRenderer
from inbounds.robots.tasks import Action, Array, Flags, HalfCheetah, Hopper, Swimmer, Task, Walker2d

TASKS: dict[str, type[Task]] = {
    task.name: task for task in (Hopper, Walker2d, HalfCheetah, Ant, Humanoid, Swimmer)
}


class RobotVectorEnv(VectorEnv[Array, Action, NDArray[Any]]):
    """N robots with one task, stepped together.

    Robot *i* seeded with *s* behaves, bit for bit, as `gymnasium.make(name)` reset with seed *s*; an integer
    seed gives robot *i* the seed *s + i*, as in `SyncVectorEnv`. Each robot has its own random generator,
    so it does not matter which others run beside it. Arrays that are returned are the caller's own (not an info's
    masks). An episode that ends is followed by a new one in the same step: `NormalizeObservation` does not take that.

    Args:
        name: of the task, a key of `TASKS` (which documents each), such as `"HalfCheetah-v5"`.
        num_envs: number of robots, N.
        action_mode: what happens to an action outside the box. `"clip"`: it is clipped before robot and
            reward see it, as by `gymnasium.wrappers.ClipAction`. `"raw"`: it is passed on as it is;
            the simulator clamps the torque, but the control cost is charged for the full action,
            as Gymnasium's tasks do when nothing clips.
        max_episode_steps: after which an episode is truncated.
        num_threads: of the physics; results do not depend on it.
        render_mode: `"rgb_array"` or None. `inbounds.robots.RobotRenderer` works with either.

    Raises:
        ValueError: an argument is not one of those above.

    Example:
        >>> import numpy as np
        >>> envs = RobotVectorEnv("HalfCheetah-v5", num_envs=2)
        >>> obs, info = envs.reset(seed=0)
        >>> obs, reward, terminated, truncated, info = envs.step(np.zeros((2, 6), np.float32))
        >>> obs.shape, reward.shape, sorted(key for key in info if key[0] != "_")
        ((2, 17), (2,), ['reward_ctrl', 'reward_forward', 'x_position', 'x_velocity'])
    """

    autoreset_mode = AutoresetMode.SAME_STEP  # where TorchRL looks for it

    def __init__(
        self,
        name: str,
        num_envs: int = 1,
        *,
        action_mode: Literal["clip", "raw"] = "clip",
        max_episode_steps: int = registration.MAX_EPISODE_STEPS,
        num_threads: int = 1,
        render_mode: str | None = None,
    ) -> None:
        counts = {"num_envs": num_envs, "max_episode_steps": max_episode_steps, "num_threads": num_threads}
        _check_arguments(name, action_mode, render_mode, counts)
        self.name = name
        self.num_envs = num_envs
        self.action_mode = action_mode
        self.max_episode_steps = max_episode_steps
        self.render_mode = render_mode

        kind = TASKS[name]
        self.model = kind.load_model()
        # Only a persistent batch can hand out the contacts that the contact forces are computed from.
        self._batch = Batch(self.model, num_envs, num_threads, persistent=kind.feels_contacts)
        self._rest = self._batch.state[0].copy()  # what every episode starts from, before its noise
        self.task = kind(self._batch)
        self.dt = self.task.dt  # of one step [s]
        self._make_spaces()

        generators = [seeding.np_random() for _ in range(num_envs)]
        self._generators = [generator for generator, _ in generators]
        self._seeds = [seed for _, seed in generators]
        self._elapsed = np.zeros(num_envs, np.int64)  # steps since the last reset
        self._position = self.task.position()  # at the end of the last step
        self._obs: Array | None = None  # the last one returned; None before the first reset
        self._everyone = np.ones(num_envs, np.bool_)
        self._everyone.flags.writeable = False
        self._renderer: RobotRenderer | None = None

    def _make_spaces(self) -> None:
        """Make spaces and metadata, the same as Gymnasium's."""
        low, high = self.model.actuator_ctrlrange.astype(np.float32).T
        self._low, self._high = low, high
        self.single_action_space = gymnasium.spaces.Box(low, high, dtype=np.float32)
        obs_size = self.task.observe().shape[1]
        self.single_observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (obs_size,), np.float64)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.metadata = {
            "autoreset_mode": self.autoreset_mode,
            "render_modes": ["rgb_array"],
            "render_fps": round(1 / self.dt),
        }

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, Info]:
        """Start new episodes.

        Args:
            seed: an integer *s* seeds robot *i* with *s + i*; a sequence gives one seed each; None, alone or in a
                sequence, goes on with the generator that is there (at first, one seeded by the system).
            options: `{"reset_mask": [N] booleans}` resets some robots only; the others go on.

        Returns:
            Observations `[N, O]`, and whereabouts as Gymnasium reports them.

        Raises:
            ValueError: the number of seeds, a seed that is no integer, or the mask does not fit.
        """
        seeds = _seeds(seed, self.num_envs)
        chosen = self._chosen(options)
        made = {r: seeding.np_random(seeds[r]) for r in np.flatnonzero(chosen) if seeds[r] is not None}
        for robot, seeded in made.items():  # all of them, or none
            self._generators[robot], self._seeds[robot] = seeded
        where = self._start(chosen)
        messages.raise_pending()
        assert self._obs is not None
        return self._obs.copy(), masked(only(chosen, where), chosen)

    def step(self, actions: Action) -> tuple[Array, Array, Flags, Flags, Info]:
        """Let every robot act once, and reset those whose episode ends.

        Args:
            actions: `[N, A]`, in the units of `action_space`.

        Returns:
            Observations `[N, O]` (of the new episode, where one ended), rewards `[N]`, terminated `[N]`,
            truncated `[N]`, and info: whereabouts, velocity [m/s] and the terms of the reward, each with its
            mask; where episodes ended also `final_obs` and `final_info`. The layout is
            that of `SyncVectorEnv` with `SAME_STEP`.

        Raises:
            ValueError: actions of the wrong shape, or NaN; in the mode "raw" infinite ones, too, which "clip" clips.
            gymnasium.error.ResetNeeded: before the first reset.
        """
        if self._obs is None:
            raise gymnasium.error.ResetNeeded("Call reset() before step().")
        task = self.task
        executed = self._executed(actions)
        task.ctrl[:] = executed
        self._batch.step(nstep=task.frame_skip)
        task.feel_contacts()

        position = task.position()
        velocity = (position - self._position) / self.dt
        self._position = position
        is_healthy = task.is_healthy()
        reward, terms = task.reward(velocity, executed, is_healthy)
        self._elapsed += 1
        terminated = ~is_healthy
        truncated = self._elapsed >= self.max_episode_steps

        self._obs = task.observe()
        info = task.where() | {"x_velocity": velocity[:, 0]} | terms
        if velocity.shape[1] > 1:
            info["y_velocity"] = velocity[:, 1]
        over = terminated | truncated
        infos = self._restart(over, info) if over.any() else masked(info, self._everyone)
        messages.raise_pending()  # the step is whole, whatever becomes of it
        return self._obs.copy(), reward, terminated, truncated, infos

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """Return one frame of each robot, `N × [240, 320, 3]`, if `render_mode` is `"rgb_array"`; else None."""
        if self.render_mode is None:
            return None
        if self._renderer is None:
            self._renderer = RobotRenderer(self)
        return tuple(self._renderer.frame(robot) for robot in range(self.num_envs))

    def close_extras(self, **kwargs: Any) -> None:
        """Free the renderer."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def get_data(self, robot: int) -> mujoco.MjData:
        """Return a copy of one robot's simulation: its state, and derived quantities only where a task needs them."""
        return self._batch.get_data(robot)

    def get_state(self) -> dict[str, Any]:
        """Return all that the future depends on: arrays, and the generators' states as plain dictionaries.

        Returns:
            A dictionary for `set_state`; it can be pickled, and shares no memory with the environment.

        Raises:
            gymnasium.error.ResetNeeded: before the first reset.
        """
        if self._obs is None:
            raise gymnasium.error.ResetNeeded("Call reset() before get_state().")
        return {
            "name": self.name,
            "physics": self._batch.state.copy(),  # [N, mjSTATE_INTEGRATION]
            "position": self._position.copy(),
            "elapsed": self._elapsed.copy(),
            "obs": self._obs.copy(),
            "generators": [rng.bit_generator.state for rng in self._generators],
            "seeds": list(self._seeds),
        }

    def set_state(self, state: dict[str, Any]) -> Array:
        """Go back to a state; what follows is, bit for bit, what followed it then.

        Args:
            state: from `get_state` of an environment with the same task and number of robots.

        Returns:
            The observations `[N, O]` that belong to the state.

        Raises:
            ValueError: the state is of another task or number of robots.
        """
        ours = (self.name, self.num_envs, *self._batch.state.shape)
        if (state["name"], len(state["generators"]), *state["physics"].shape) != ours:
            raise ValueError(
                f"The state is of {len(state['physics'])} × {state['name']}, this environment has "
                f"{self.num_envs} × {self.name}: make it with the same name and num_envs."
            )
        self._batch.state[:] = state["physics"]
        self._position = state["position"].copy()
        self._elapsed[:] = state["elapsed"]
        self._obs = state["obs"].copy()
        self._seeds = list(state["seeds"])
        for rng, saved in zip(self._generators, state["generators"], strict=True):
            rng.bit_generator.state = saved
        return self._obs.copy()

    @property  # type: ignore[misc]
    def np_random(self) -> tuple[np.random.Generator, ...]:  # type: ignore[override]
        """Each robot's generator."""
        return tuple(self._generators)

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # type: ignore[override]
        """Each robot's last seed."""
        return tuple(self._seeds)

    def _chosen(self, options: dict[str, Any] | None) -> Flags:
        """Return the robots that a reset is about."""
        mask = (options or {}).get("reset_mask")
        if mask is None:
            return self._everyone
        mask = np.array(mask)  # the caller may go on with theirs
        if mask.shape != (self.num_envs,) or mask.dtype != np.bool_ or not mask.any():
            raise ValueError(
                f"reset_mask must be {self.num_envs} booleans, at least one of them True; got {mask!r}"
            )
        if self._obs is None and not mask.all():
            raise gymnasium.error.ResetNeeded("Reset all robots before resetting some of them.")
        return mask

    def _executed(self, actions: Action) -> Action:
        """Return the actions as the robots receive them, in the precision in which they came."""
        actions = np.asarray(actions)
        if actions.shape != self.action_space.shape:
            raise ValueError(f"Actions must have the shape {self.action_space.shape}, got {actions.shape}")
        if actions.dtype not in (np.float32, np.float64):
            actions = actions.astype(np.float32)
        if self.action_mode == "clip":
            actions = np.minimum(np.maximum(actions, self._low), self._high)  # np.clip, several times as fast
        if not np.isfinite(actions).all():
            bad = np.flatnonzero(~np.isfinite(actions).all(axis=1)).tolist()
            raise ValueError(
                f"The actions of robots {bad} are not finite: has their policy diverged? "
                "Replace them (say, by zeros) to let the other robots go on."
            )
        return actions

    def _start(self, chosen: Flags) -> dict[str, NDArray]:
        """Reset the chosen robots, refresh what is known about them, and return the whereabouts of all."""
        robots = np.flatnonzero(chosen).astype(np.int32)
        self._batch.state[robots] = self._rest  # as Batch.reset does, at a tenth of its cost
        for robot in robots:
            self.task.qpos[robot], self.task.qvel[robot] = self.task.draw_start(self._generators[robot])
        self._batch.forward(robots)
        self.task.forget_contacts(robots)
        self._elapsed[robots] = 0
        self._position[robots] = self.task.position()[robots]
        obs = self.task.observe()
        if self._obs is None:
            self._obs = obs
        else:
            self._obs[robots] = obs[robots]
        return self.task.where()

    def _restart(self, over: Flags, info: dict[str, NDArray]) -> Info:
        """Reset the robots whose episode is over; return the infos, with those of the old episodes' ends."""
        assert self._obs is not None
        final_obs = np.full(self.num_envs, None, dtype=object)
        for robot in np.flatnonzero(over):
            final_obs[robot] = self._obs[robot].copy()
        final_info = masked(only(over, info), over)
        where = self._start(over)
        infos: Info = {
            "final_obs": final_obs,
            "_final_obs": over,
            "final_info": final_info,
            "_final_info": over,
        }
        # What is said of a step is not known of robots that have just been reset.
        of_step = {key: values for key, values in info.items() if key not in where}
        infos |= masked(where, self._everyone) | masked(only(~over, of_step), ~over)
        return infos


def _seeds(seed: int | Sequence[int | None] | None, num_envs: int) -> list[int | None]:
    """Return a seed for each robot; None goes on with the generator that is there."""
    if isinstance(seed, int | np.integer):
        return [int(seed) + i for i in range(num_envs)]
    several = isinstance(seed, Iterable) and getattr(seed, "ndim", 1) == 1
    each = [None] * num_envs if seed is None else list(seed) if several else []
    if len(each) != num_envs or not all(s is None or isinstance(s, int | np.integer) for s in each):
        raise ValueError(f"Pass one seed for each of the {num_envs} robots, or one integer; got {seed!r}")
    return [None if s is None else int(s) for s in each]


def _check_arguments(name: str, action_mode: str, render_mode: str | None, counts: dict[str, int]) -> None:
    if name not in TASKS:
        raise ValueError(f"There is no task {name!r}; there are {', '.join(TASKS)}")
    if action_mode not in ("clip", "raw"):
        raise ValueError(f"action_mode must be 'clip' or 'raw', got {action_mode!r}")
    if render_mode not in (None, "rgb_array"):
        raise ValueError(f"render_mode must be None or 'rgb_array', got {render_mode!r}")
    for argument, count in counts.items():
        if not isinstance(count, Integral) or count < 1:
            raise ValueError(f"{argument} must be a whole number, at least 1, got {count}")
