// A policy that moves a robot through one episode after another, and what is counted on the way.
"use strict";

inbounds.live.Player = class {
  static MARGIN = 1e-3; // of half the range: an executed action closer than this to a bound counts as at the bound
  static LIMIT = 1000; // env steps of an episode

  constructor(world, policy) {
    this.world = world;
    this.policy = policy;
    this.way = "sample";
    this.spread = 1;
  }

  // Start an episode. Two players with the same seed start in the same state and are given the same noise.
  reset(seed) {
    const { Noise } = inbounds.live;
    this.world.reset(new Noise(seed));
    this.noise = new Noise(seed + 0x5eed);
    Object.assign(this, { total: 0, steps: 0, speed: 0, atBounds: 0, beyond: 0, over: null, told: null });
    this.decide();
  }

  get seconds() {
    return (this.steps + this.world.substeps / this.world.task.frame_skip) * this.world.dt;
  }

  // Choose the next action. Noise is drawn whether it is used or not, so that both players stay in step.
  decide() {
    const noise = this.noise.normals(this.policy.low.length);
    this.seen = this.world.observe();
    this.parameters = this.policy.parameters(this.seen, this.spread);
    this.told = this.policy.act(this.parameters, this.way, noise);
    this.world.tell(this.policy.inBox(this.told.executed));
  }

  // Let the noise be so many times as large from the next action on; the law that it will have is there at once.
  widen(spread) {
    this.spread = spread;
    if (this.seen) this.parameters = this.policy.parameters(this.seen, spread);
  }

  // One step of the physics; true when a step of the environment is complete.
  advance() {
    if (this.over) return true;
    const step = this.world.advance();
    if (!step) return false;
    this.count(step);
    if (!this.over) this.decide();
    return true;
  }

  count({ reward, speed, terminated }) {
    const { MARGIN, LIMIT } = inbounds.live.Player;
    this.steps += 1;
    this.total += reward;
    this.speed += Math.min(1, this.world.dt / 0.3) * (speed - this.speed); // smoothed over a third of a second
    const motors = this.told.executed.length;
    this.atBounds += this.told.executed.filter((unit) => Math.abs(unit) > 1 - MARGIN).length / motors;
    this.beyond += this.told.drawn.filter((unit) => Math.abs(unit) > 1).length / motors;
    if (terminated) this.over = "fell";
    else if (this.steps >= LIMIT) this.over = "reached the end";
  }

  // What the page says in numbers.
  readings() {
    const share = (count) => (this.steps ? count / this.steps : 0);
    return {
      total: this.total,
      speed: this.speed,
      steps: this.steps,
      seconds: this.seconds,
      atBounds: share(this.atBounds),
      beyond: share(this.beyond),
      over: this.over,
    };
  }
};

// Let a player finish one episode, without drawing anything: {total, steps, over}.
inbounds.live.episode = (player, seed) => {
  player.reset(seed);
  while (!player.over) player.advance();
  return player.readings();
};
