"""Ant and Humanoid: the two tasks that feel the forces of their contacts.

Gymnasium calls `mj_rnePostConstraint` after each step to know these forces. A batch does not compute them, so
they are computed here, robot by robot where something touches, from the data that a persistent batch keeps. That
costs some 7 µs a touching robot and step, one to three per cent of the physics.
"""

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from inbounds.robots.tasks import Action, Array, Flags, Task, place_on_ground, squared_norm


class ContactTask(Task):
    """A task with contact forces `[N, bodies, 6]` (torque, then force, on each body) [N·m, N]."""

    hidden = 2
    feels_contacts = True

    def __init__(self, batch: Batch) -> None:
        super().__init__(batch)
        self._batch = batch
        self._data = mujoco.MjData(batch.model)
        self._num_contacts: NDArray[np.int32] = batch.bind("ncon")  # [N], live
        self.contact_forces: Array = np.zeros((batch.nsim, *self._data.cfrc_ext.shape))

    def feel_contacts(self) -> None:
        """Compute the contact forces of the last physics step, robot by robot."""
        self.contact_forces[:] = 0.0
        for robot in np.flatnonzero(self._num_contacts):  # where nothing touches there is no force
            self._batch.get_data(robot, self._data)
            mujoco.mj_rnePostConstraint(self._batch.model, self._data)
            self.contact_forces[robot] = self._data.cfrc_ext

    def forget_contacts(self, robots: NDArray[np.int32]) -> None:
        """Set the forces of robots just reset to zero: Gymnasium knows none until the next step."""
        self.contact_forces[robots] = 0.0

    def where(self) -> dict[str, NDArray]:
        """Return the place on the ground and the distance from the origin [m]."""
        return place_on_ground(self.qpos)


class Ant(ContactTask):
    """Ant-v5: a torso on four legs (Schulman et al. 2016, *GAE*).

    ============  =====================================================================  ==========
    Index         Meaning                                                                Unit
    ============  =====================================================================  ==========
    action 0–7    torque at hip and ankle of the right back, front left, front right     box [−1, 1];
                  and back left leg, gear 150                                            gear in N·m
    obs 0         height of the torso, z                                                 m
    obs 1–4       orientation of the torso, a unit quaternion                            –
    obs 5–12      angles of hip and ankle: front left, front right, back left,           rad
                  right back leg
    obs 13–15     velocity of the torso along x, y, z                                    m/s
    obs 16–18     angular velocity of the torso                                          rad/s
    obs 19–26     joint rates, in the order of the angles                                rad/s
    obs 27–104    contact torque and force on each of 13 bodies, clipped to ± 1          N·m, N
    reward        dx/dt of the torso + 1 · [healthy] − 0.5 · ‖action‖²                   1 per step
                  − 0.0005 · ‖clipped contact forces‖²
    termination   unhealthy, that is not (0.2 m ≤ z ≤ 1 m and all finite);               –
                  truncation at 1000 steps
    start         reference pose; positions ± U(0.1), velocities 0.1 · N(0, 1)           as above
    step          0.05 s: 5 physics steps of 0.01 s                                      s
    ============  =====================================================================  ==========

    Example:
        >>> from inbounds.robots import make
        >>> envs = make("Ant-v5", num_envs=2)
        >>> envs.observation_space.shape, envs.action_space.shape, round(float(envs.action_space.high[0, 0]), 1)
        ((2, 105), (2, 8), 1.0)
    """

    name = "Ant-v5"
    xml_file = "ant.xml"
    frame_skip = 5
    control_weight = 0.5
    contact_weight = 5e-4
    healthy_reward = 1.0
    reset_noise = 0.1
    reset_velocity_is_normal = True

    def __init__(self, batch: Batch) -> None:
        super().__init__(batch)
        self._torso: Array = batch.bind("xpos")[:, 1]  # [N, 3], live

    def observe(self) -> Array:
        """Return posture, velocities and clipped contact forces, `[N, 105]`."""
        forces = np.clip(self.contact_forces[:, 1:], -1, 1)  # the first body is the world
        return np.concatenate((super().observe(), forces.reshape(len(forces), -1)), axis=1)

    def position(self) -> Array:
        """Return the torso as the physics last saw it, one physics step behind `qpos`; Gymnasium rewards this one."""
        return self._torso[:, :2].copy()

    def is_healthy(self) -> Flags:
        """Return who is neither too low nor too high, and all finite; an ant on its back may be healthy."""
        height = self.qpos[:, 2]
        is_finite = np.isfinite(self.qpos).all(axis=1) & np.isfinite(self.qvel).all(axis=1)
        return is_finite & (height >= 0.2) & (height <= 1.0)

    def contact_cost(self) -> Array:
        """Return the weighted squared norm of the clipped contact forces, `[N]`."""
        forces = np.clip(self.contact_forces, -1, 1).reshape(len(self.contact_forces), -1)
        return self.contact_weight * squared_norm(forces)


class Humanoid(ContactTask):
    """Humanoid-v5: a body of 17 actuated joints that learns to walk (Tassa, Erez & Todorov 2012).

    ============  =====================================================================  ==========
    Index         Meaning                                                                Unit
    ============  =====================================================================  ==========
    action 0–16   torque at abdomen y, z, x; right hip x, z, y, knee; left hip x, z,     box [−0.4, 0.4];
                  y, knee; right shoulder 1, 2, elbow; left shoulder 1, 2, elbow;        gear in N·m
                  gear 100, but hip y 300, knees 200, arms 25
    obs 0         height of the torso, z                                                 m
    obs 1–4       orientation of the torso, a unit quaternion                            –
    obs 5–21      joint angles: as the actions, but abdomen z, y, x                      rad
    obs 22–24     velocity of the torso along x, y, z                                    m/s
    obs 25–27     angular velocity of the torso                                          rad/s
    obs 28–44     joint rates, in the order of the angles                                rad/s
    obs 45–174    inertia, first moment and mass of 13 bodies, about the common          kg·m², kg·m,
                  centre of mass (10 numbers each)                                       kg
    obs 175–252   angular and linear velocity of 13 bodies                               rad/s, m/s
    obs 253–269   torque of the actuators at the joints                                  N·m
    obs 270–347   contact torque and force on each of 13 bodies                          N·m, N
    reward        1.25 · dx/dt of the centre of mass + 5 · [healthy]                     1 per step
                  − 0.1 · ‖action‖² − min(5·10⁻⁷ · ‖contact forces‖², 10)
    termination   unhealthy, that is not (1 m < z < 2 m); truncation at 1000 steps       –
    start         reference pose; positions and velocities ± U(0.01)                     as above
    step          0.015 s: 5 physics steps of 0.003 s                                    s
    ============  =====================================================================  ==========

    Example:
        >>> from inbounds.robots import make
        >>> envs = make("Humanoid-v5", num_envs=2)
        >>> envs.observation_space.shape, envs.action_space.shape, round(float(envs.action_space.high[0, 0]), 1)
        ((2, 348), (2, 17), 0.4)
    """

    name = "Humanoid-v5"
    xml_file = "humanoid.xml"
    frame_skip = 5
    forward_weight = 1.25
    control_weight = 0.1
    contact_weight = 5e-7
    contact_limit = 10.0
    healthy_reward = 5.0
    reset_noise = 1e-2

    def __init__(self, batch: Batch) -> None:
        super().__init__(batch)
        self._mass: Array = batch.model.body_mass.copy()
        self._body_centres: Array = batch.bind("xipos")  # [N, bodies, 3], live, as all that follow
        self._inertia: Array = batch.bind("cinert")
        self._velocity: Array = batch.bind("cvel")
        self._torque: Array = batch.bind("qfrc_actuator")
        self._tendons: dict[str, Array] = {
            "tendon_length": batch.bind("ten_length"),
            "tendon_velocity": batch.bind("ten_velocity"),
        }

    def observe(self) -> Array:
        """Return posture, velocities, inertia, torques and contact forces, `[N, 348]`."""
        count = len(self.qpos)
        parts = (
            super().observe(),
            self._inertia[:, 1:].reshape(count, -1),  # the first body is the world
            self._velocity[:, 1:].reshape(count, -1),
            self._torque[:, 6:],  # the first six belong to the torso, which has no motor
            self.contact_forces[:, 1:].reshape(count, -1),
        )
        return np.concatenate(parts, axis=1)

    def position(self) -> Array:
        """Return the centre of mass on the ground, as the physics last saw it, `[N, 2]` [m]."""
        return (np.einsum("b,nbj->nj", self._mass, self._body_centres) / self._mass.sum())[:, :2]

    def is_healthy(self) -> Flags:
        """Return who is neither fallen nor flying."""
        return (self.qpos[:, 2] > 1.0) & (self.qpos[:, 2] < 2.0)

    def control_cost(self, action: Action) -> Array:
        """Return what Gymnasium charges this robot for: the simulator's controls, which are the action in float64."""
        return super().control_cost(self.ctrl)

    def contact_cost(self) -> Array:
        """Return the weighted squared norm of the contact forces, limited, `[N]`."""
        forces = self.contact_forces.reshape(len(self.contact_forces), -1)
        return np.minimum(self.contact_weight * squared_norm(forces), self.contact_limit)

    def where(self) -> dict[str, NDArray]:
        """Return place on the ground, distance from the origin [m], lengths and rates of the two tendons [m, m/s]."""
        return super().where() | {name: values.copy() for name, values in self._tendons.items()}
