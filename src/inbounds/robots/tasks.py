"""What a robot sees, what it is paid for, when it falls, and how it starts: four of the six v5 tasks.

Each task is written once, for a batch: `[N, …]` arrays hold N robots, and every formula is Gymnasium's, in
Gymnasium's order of operations, so that the numbers agree to the last bit. Ant and Humanoid, which also feel
contact forces, are in `inbounds.robots.contact_tasks`.

Actions are numbers in a box; a motor multiplies them by its gear. All lengths are in metres, angles in radians,
torques in N·m, masses in kg. A step of the environment is `frame_skip` steps of the physics.

Sources: Brockman et al. 2016, *OpenAI Gym*; Todorov, Erez & Tassa 2012, *MuJoCo*; the tasks' own papers are named
in each docstring.
"""

from pathlib import Path
from typing import Any, ClassVar

import gymnasium
import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from inbounds.robots import messages

messages.install_handler()

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Action = NDArray[np.floating[Any]]

ASSETS = Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets"


class Task:
    """A task over a batch of robots: the rule that all six follow, with the parts in which they differ.

    One step is paid

        reward = w_forward · dx/dt + healthy_reward · [healthy] − w_control · ‖action‖² − contact cost,

    where a task without health or contacts lacks that term.

    Args:
        batch: simulations of `load_model`'s model; the task keeps live views of their state.
    """

    name: ClassVar[str]
    """Gymnasium's id."""
    xml_file: ClassVar[str]
    frame_skip: ClassVar[int]
    hidden: ClassVar[int] = 1
    """How many leading coordinates the robot does not see: its place on the ground."""
    forward_weight: ClassVar[float] = 1.0
    control_weight: ClassVar[float]
    healthy_reward: ClassVar[float] = 0.0
    """Paid at every healthy step; zero for a task that has no health and never terminates."""
    velocity_limit: ClassVar[float | None] = None
    """Velocities are observed clipped to ± this [m/s, rad/s]."""
    reset_noise: ClassVar[float]
    reset_velocity_is_normal: ClassVar[bool] = False
    feels_contacts: ClassVar[bool] = False
    """Whether contact forces have to be computed after every step."""

    def __init__(self, batch: Batch) -> None:
        self.dt = batch.model.opt.timestep * self.frame_skip  # of one environment step [s]
        self.qpos: Array = batch.bind("qpos")  # [N, nq], live
        self.qvel: Array = batch.bind("qvel")  # [N, nv], live
        self.ctrl: Array = batch.bind("ctrl")  # [N, A], live
        self.initial_qpos: Array = batch.model.qpos0.copy()

    @classmethod
    def load_model(cls) -> mujoco.MjModel:
        """Return the robot's MuJoCo model, from the files that Gymnasium ships."""
        return mujoco.MjModel.from_xml_path(str(ASSETS / cls.xml_file))

    def observe(self) -> Array:
        """Return what each robot sees now, `[N, O]`, a new array."""
        velocity = self.qvel
        if self.velocity_limit is not None:
            velocity = np.minimum(np.maximum(velocity, -self.velocity_limit), self.velocity_limit)
        return np.concatenate((self.qpos[:, self.hidden :], velocity), axis=1)

    def position(self) -> Array:
        """Return the place whose rate of change is rewarded, `[N, 1]` (x) or `[N, 2]` (x, y) [m], a new array."""
        return self.qpos[:, : self.hidden].copy()

    def is_healthy(self) -> Flags:
        """Return whether each robot is upright, `[N]`; an unhealthy one terminates."""
        return np.ones(len(self.qpos), np.bool_)

    def reward(self, velocity: Array, action: Action, is_healthy: Flags) -> tuple[Array, dict[str, NDArray]]:
        """Pay for one step.

        Args:
            velocity: mean velocity over the step, `[N, 1 or 2]` [m/s].
            action: what the robot received, `[N, A]`; the cost is computed in its precision.
            is_healthy: after the step, `[N]`.

        Returns:
            The reward `[N]` and its terms, whose sum it is (to rounding).
        """
        gain = forward = self.forward_weight * velocity[:, 0]
        cost = control = self.control_cost(action)
        terms = {"reward_forward": forward, "reward_ctrl": -control}
        if self.healthy_reward:
            terms["reward_survive"] = is_healthy * self.healthy_reward
            gain = forward + terms["reward_survive"]
        if self.feels_contacts:
            contact = self.contact_cost()
            terms["reward_contact"] = -contact
            cost = control + contact
        return gain - cost, terms

    def control_cost(self, action: Action) -> NDArray:
        """Return what the action costs, `[N]`, in the action's precision."""
        return self.control_weight * squared_norm(action)

    def contact_cost(self) -> Array:
        """Return what the contacts cost, `[N]`; only for a task that feels them."""
        raise NotImplementedError(f"{self.name} feels no contacts")

    def feel_contacts(self) -> None:
        """Compute the contact forces of the last physics step, where the task needs them."""

    def forget_contacts(self, robots: NDArray[np.int32]) -> None:
        """Set the contact forces of these robots, just reset, to zero, where the task needs them."""

    def where(self) -> dict[str, NDArray]:
        """Return what Gymnasium reports about the robots' whereabouts, at a reset and after a step, new arrays."""
        return {"x_position": self.qpos[:, 0].copy()}

    def draw_start(self, rng: np.random.Generator) -> tuple[Array, Array]:
        """Return one robot's initial `qpos [nq]` and `qvel [nv]`: the reference pose and a little noise."""
        noise, count = self.reset_noise, (self.qvel.shape[1],)
        qpos = self.initial_qpos + rng.uniform(-noise, noise, self.initial_qpos.size)
        if self.reset_velocity_is_normal:
            return qpos, noise * rng.standard_normal(count)
        return qpos, rng.uniform(-noise, noise, count)


class HalfCheetah(Task):
    """HalfCheetah-v5: a planar two-legged runner that cannot fall out of its task (Wawrzyński 2009).

    ============  =====================================================================  ==========
    Index         Meaning                                                                Unit
    ============  =====================================================================  ==========
    action 0–5    torque at back thigh, shin, foot, front thigh, shin, foot,             box [−1, 1];
                  with gears 120, 90, 60, 120, 60, 30                                    gear in N·m
    obs 0         height of the torso (relative to the reference pose)                   m
    obs 1         pitch of the torso                                                     rad
    obs 2–7       joint angles, in the order of the actions                              rad
    obs 8–9       velocity of the torso, forwards and upwards                            m/s
    obs 10        pitch rate of the torso                                                rad/s
    obs 11–16     joint rates, in the order of the actions                               rad/s
    reward        dx/dt − 0.1 · ‖action‖²                                                1 per step
    termination   never; truncation at 1000 steps                                        –
    start         reference pose; positions ± U(0.1), velocities 0.1 · N(0, 1)           as above
    step          0.05 s: 5 physics steps of 0.01 s                                      s
    ============  =====================================================================  ==========

    Example:
        >>> from inbounds.robots import make
        >>> envs = make("HalfCheetah-v5", num_envs=2)
        >>> envs.observation_space.shape, envs.action_space.shape, round(float(envs.action_space.high[0, 0]), 1)
        ((2, 17), (2, 6), 1.0)
    """

    name = "HalfCheetah-v5"
    xml_file = "half_cheetah.xml"
    frame_skip = 5
    control_weight = 0.1
    reset_noise = 0.1
    reset_velocity_is_normal = True


class Swimmer(Task):
    """Swimmer-v5: three links in a viscous fluid, seen from above (Coulom 2002).

    ============  =====================================================================  ==========
    Index         Meaning                                                                Unit
    ============  =====================================================================  ==========
    action 0–1    torque at the first and the second joint, gear 150                     box [−1, 1];
                                                                                         gear in N·m
    obs 0         heading of the front link                                              rad
    obs 1–2       joint angles                                                           rad
    obs 3–4       velocity, along x and y, of the point that is paid: on the front       m/s
                  link's line, 0.5 m behind the first joint
    obs 5         turning rate of the front link                                         rad/s
    obs 6–7       joint rates                                                            rad/s
    reward        dx/dt − 0.0001 · ‖action‖²                                             1 per step
    termination   never; truncation at 1000 steps                                        –
    start         reference pose; positions and velocities ± U(0.1)                      as above
    step          0.04 s: 4 physics steps of 0.01 s                                      s
    ============  =====================================================================  ==========

    Example:
        >>> from inbounds.robots import make
        >>> envs = make("Swimmer-v5", num_envs=2)
        >>> envs.observation_space.shape, envs.action_space.shape, round(float(envs.action_space.high[0, 0]), 1)
        ((2, 8), (2, 2), 1.0)
    """

    name = "Swimmer-v5"
    xml_file = "swimmer.xml"
    frame_skip = 4
    hidden = 2
    control_weight = 1e-4
    reset_noise = 0.1

    def where(self) -> dict[str, NDArray]:
        """Return the place on the ground and the distance from the origin [m]."""
        return place_on_ground(self.qpos)


class Hopper(Task):
    """Hopper-v5: one leg that hops in a plane (Erez, Tassa & Todorov 2011).

    ============  =====================================================================  ==========
    Index         Meaning                                                                Unit
    ============  =====================================================================  ==========
    action 0–2    torque at thigh, leg and foot joint, gear 200                          box [−1, 1];
                                                                                         gear in N·m
    obs 0         height of the torso, z                                                 m
    obs 1         pitch of the torso                                                     rad
    obs 2–4       angles of thigh, leg and foot joint                                    rad
    obs 5–6       velocity of the torso, forwards and upwards, clipped to ± 10           m/s
    obs 7         pitch rate of the torso, clipped to ± 10                               rad/s
    obs 8–10      joint rates, clipped to ± 10                                           rad/s
    reward        dx/dt + 1 · [healthy] − 0.001 · ‖action‖²                              1 per step
    termination   unhealthy, that is not (z > 0.7 m, pitch within ± 0.2 rad, all else    –
                  but x within ± 100); truncation at 1000 steps
    start         reference pose; positions and velocities ± U(0.005)                    as above
    step          0.008 s: 4 physics steps of 0.002 s                                    s
    ============  =====================================================================  ==========

    Example:
        >>> from inbounds.robots import make
        >>> envs = make("Hopper-v5", num_envs=2)
        >>> envs.observation_space.shape, envs.action_space.shape, round(float(envs.action_space.high[0, 0]), 1)
        ((2, 11), (2, 3), 1.0)
    """

    name = "Hopper-v5"
    xml_file = "hopper.xml"
    frame_skip = 4
    control_weight = 1e-3
    healthy_reward = 1.0
    velocity_limit = 10.0
    reset_noise = 5e-3

    def is_healthy(self) -> Flags:
        """Return who is high enough (but not infinitely), upright, and within ± 100 in all but x and z."""
        others = np.concatenate((self.qpos[:, 2:], self.qvel), axis=1)
        others_are_small = np.logical_and.reduce(np.abs(others) < 100, axis=1)
        height, pitch = self.qpos[:, 1], self.qpos[:, 2]
        return others_are_small & (height > 0.7) & (height < np.inf) & (np.abs(pitch) < 0.2)

    def where(self) -> dict[str, NDArray]:
        """Return the place along the track and the height above the reference pose [m]."""
        height = self.qpos[:, 1] - self.initial_qpos[1]
        return {"x_position": self.qpos[:, 0].copy(), "z_distance_from_origin": height}


class Walker2d(Hopper):
    """Walker2d-v5: two legs that walk in a plane (Erez, Tassa & Todorov 2011).

    ============  =====================================================================  ==========
    Index         Meaning                                                                Unit
    ============  =====================================================================  ==========
    action 0–5    torque at right thigh, leg, foot, left thigh, leg, foot, gear 100      box [−1, 1];
                                                                                         gear in N·m
    obs 0         height of the torso, z                                                 m
    obs 1         pitch of the torso                                                     rad
    obs 2–7       joint angles, in the order of the actions                              rad
    obs 8–9       velocity of the torso, forwards and upwards, clipped to ± 10           m/s
    obs 10        pitch rate of the torso, clipped to ± 10                               rad/s
    obs 11–16     joint rates, in the order of the actions, clipped to ± 10              rad/s
    reward        dx/dt + 1 · [healthy] − 0.001 · ‖action‖²                              1 per step
    termination   unhealthy, that is not (0.8 m < z < 2 m and pitch within ± 1 rad);     –
                  truncation at 1000 steps
    start         reference pose; positions and velocities ± U(0.005)                    as above
    step          0.008 s: 4 physics steps of 0.002 s                                    s
    ============  =====================================================================  ==========

    Example:
        >>> from inbounds.robots import make
        >>> envs = make("Walker2d-v5", num_envs=2)
        >>> envs.observation_space.shape, envs.action_space.shape, round(float(envs.action_space.high[0, 0]), 1)
        ((2, 17), (2, 6), 1.0)
    """

    name = "Walker2d-v5"
    xml_file = "walker2d_v5.xml"

    def is_healthy(self) -> Flags:
        """Return who is neither fallen nor flying, and upright."""
        height, pitch = self.qpos[:, 1], self.qpos[:, 2]
        return (height > 0.8) & (height < 2.0) & (np.abs(pitch) < 1.0)


def squared_norm(rows: NDArray[Any]) -> NDArray[Any]:
    """Return the sum of squares of each row, in the order of NumPy's sum over one row: `[N, K] → [N]`.

    Example:
        >>> squared_norm(np.array([[3.0, 4.0], [1.0, 2.0]]))
        array([25.,  5.])
    """
    squares: NDArray[Any] = np.add.reduce(np.square(rows), axis=1)  # as .sum(), without its overhead
    return squares


def place_on_ground(qpos: Array) -> dict[str, NDArray]:
    """Return place (x, y) and distance from the origin [m] of robots that move on a plane, `[N]` each."""
    place = qpos[:, :2]
    return {
        "x_position": place[:, 0].copy(),
        "y_position": place[:, 1].copy(),
        "distance_from_origin": np.sqrt(np.vecdot(place, place)),
    }
