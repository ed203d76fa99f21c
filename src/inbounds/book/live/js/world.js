// A robot in MuJoCo's WebAssembly: what it sees, what it is paid, when it falls. Mirrors inbounds.robots.tasks and
// contact_tasks, formula by formula; the numbers of a task come from there, in `robot.task`.
"use strict";

inbounds.live.World = class {
  // mujoco: the loaded module; robot: {name, xml, motors, task} as inbounds.book.live.export writes it.
  constructor(mujoco, robot) {
    this.mujoco = mujoco;
    this.robot = robot;
    this.task = robot.task;
    this.model = mujoco.MjModel.from_xml_string(robot.xml);
    this.data = new mujoco.MjData(this.model);
    this.timestep = this.model.opt.timestep;
    this.dt = this.timestep * this.task.frame_skip;
    this.mass = Float64Array.from(this.model.body_mass);
    this.totalMass = this.mass.reduce((sum, m) => sum + m, 0);
    this.substeps = 0;
    this.elapsed = 0;
    this.pushed = null;
  }

  delete() {
    this.data.delete();
    this.model.delete();
  }

  // The reference pose and a little noise, as Gymnasium starts an episode.
  reset(random) {
    const { reset_noise: size, reset_velocity_is_normal: isNormal } = this.task;
    const around = () => size * (2 * random.uniform() - 1);
    const rest = this.model.qpos0;
    const qpos = Array.from(rest, (x) => x + around());
    const qvel = Array.from({ length: this.model.nv }, () => (isNormal ? size * random.normal() : around()));
    this.put({ qpos, qvel });
  }

  // Go to a state: positions and velocities, and, to repeat a recorded step, what else the step depends on.
  put({ qpos, qvel, warmstart = null, position = null }) {
    this.mujoco.mj_resetData(this.model, this.data);
    this.data.qpos.set(qpos);
    this.data.qvel.set(qvel);
    this.mujoco.mj_forward(this.model, this.data);
    if (warmstart) this.data.qacc_warmstart.set(warmstart);
    this.data.cfrc_ext.fill(0); // Gymnasium knows no contact forces until the first step
    this.substeps = 0;
    this.elapsed = 0;
    this.position = position ?? this.place();
  }

  // The place whose rate of change is paid: of the torso (Ant), of the centre of mass (Humanoid), or the coordinate.
  place() {
    if (this.robot.name === "Ant-v5") return Array.from(this.data.xpos.subarray(3, 5));
    if (this.robot.name === "Humanoid-v5") {
      const centres = this.data.xipos;
      return [0, 1].map((axis) => this.mass.reduce((sum, m, b) => sum + m * centres[3 * b + axis], 0) / this.totalMass);
    }
    return Array.from(this.data.qpos.subarray(0, this.task.hidden));
  }

  observe() {
    const limit = this.task.velocity_limit ?? Infinity;
    const seen = [...this.data.qpos.subarray(this.task.hidden)];
    for (const v of this.data.qvel) seen.push(Math.min(Math.max(v, -limit), limit));
    if (this.robot.name === "Ant-v5") {
      for (const force of this.data.cfrc_ext.subarray(6)) seen.push(Math.min(Math.max(force, -1), 1));
    } else if (this.robot.name === "Humanoid-v5") {
      seen.push(...this.data.cinert.subarray(10), ...this.data.cvel.subarray(6));
      seen.push(...this.data.qfrc_actuator.subarray(6), ...this.data.cfrc_ext.subarray(6));
    }
    return seen;
  }

  isHealthy() {
    const { qpos, qvel } = this.data;
    const within = (x, low, high) => x > low && x < high;
    switch (this.robot.name) {
      case "Hopper-v5": {
        const small = [...qpos.subarray(2), ...qvel].every((x) => Math.abs(x) < 100);
        return small && qpos[1] > 0.7 && qpos[1] < Infinity && Math.abs(qpos[2]) < 0.2;
      }
      case "Walker2d-v5":
        return within(qpos[1], 0.8, 2) && within(qpos[2], -1, 1);
      case "Ant-v5":
        return [...qpos, ...qvel].every(Number.isFinite) && qpos[2] >= 0.2 && qpos[2] <= 1;
      case "Humanoid-v5":
        return within(qpos[2], 1, 2);
      default:
        return true; // HalfCheetah and Swimmer never terminate
    }
  }

  // Tell the motors what to do in the physics steps that follow.
  tell(action) {
    this.data.ctrl.set(action);
    this.action = action;
  }

  // One step of the physics. At the end of a step of the environment: what the robot is paid, and whether it is over.
  advance() {
    this.data.xfrc_applied.fill(0);
    if (this.pushed) this.data.xfrc_applied.set(this.pushed.force, 6 * this.pushed.body);
    this.mujoco.mj_step(this.model, this.data);
    if (++this.substeps < this.task.frame_skip) return null;
    this.substeps = 0;
    this.elapsed += 1;
    if (this.task.feels_contacts) this.mujoco.mj_rnePostConstraint(this.model, this.data);
    const place = this.place();
    const speed = (place[0] - this.position[0]) / this.dt;
    this.position = place;
    const healthy = this.isHealthy();
    return { reward: this.reward(speed, healthy), speed, terminated: !healthy };
  }

  reward(speed, healthy) {
    const { forward_weight, control_weight, healthy_reward } = this.task;
    const effort = this.action.reduce((sum, a) => sum + a * a, 0);
    const cost = control_weight * effort + (this.task.feels_contacts ? this.contactCost() : 0);
    return forward_weight * speed + (healthy ? healthy_reward : 0) - cost;
  }

  contactCost() {
    const { contact_weight: weight, contact_limit: limit } = this.task;
    const forces = this.data.cfrc_ext;
    if (limit) return Math.min(weight * forces.reduce((sum, f) => sum + f * f, 0), limit);
    return weight * forces.reduce((sum, f) => sum + Math.min(Math.max(f, -1), 1) ** 2, 0);
  }
};
