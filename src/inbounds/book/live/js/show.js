// One or two robots on one clock, and the controls that both share.
"use strict";

// The policy of a cell's seed. Only its own file is loaded, once a page.
inbounds.live.policyOf = async (robot, policy, seed, untrained) => {
  const { live } = inbounds;
  await live.load(`robots/${robot}.js`);
  const id = `${robot.toLowerCase()}-${policy}-${seed}`;
  await live.load(`policies/${id}.js`);
  const stored = live.policies[id];
  let start = null;
  if (untrained) {
    const name = `${robot.toLowerCase()}-${seed}`;
    await live.load(`starts/${name}.js`);
    start = await live.unpack(live.starts[name]);
  }
  return new live.Policy(stored, await live.unpack(stored.numbers), start);
};

inbounds.live.Show = class {
  static SPEEDS = { 1: "real time", 0.5: "half speed", 0.25: "quarter speed", 0.1: "a tenth" };
  static PAUSE = 1.5; // seconds between two episodes
  static EVERY = 10; // seconds of the reader's time between two sentences to a screen reader
  static PUSH = 0.2; // seconds that a push lasts

  constructor(element, mujoco) {
    const { robot, left, right, seed } = element.dataset;
    const ways = element.dataset.ways.split(" ");
    Object.assign(this, { element, mujoco, robot, seed: Number(seed), untrained: false, rate: 1, start: 0, owed: 0 });
    this.playing = !matchMedia("(prefers-reduced-motion: reduce)").matches;
    this.visible = true;
    this.panels = [["First robot", left], ["Second robot", right]].map(
      ([title, policy], i) => new inbounds.live.Panel(this, title, policy, ways[i]),
    );
    this.build();
  }

  build() {
    const { make, choice, button } = inbounds.live.dom;
    const { robots, seeds } = inbounds.live.catalogue;
    const set = (name, parse = String) => (value) => {
      this[name] = parse(value);
      this.change();
    };
    const views = Object.fromEntries(Object.keys(inbounds.live.VIEWS).map((name) => [name, name]));
    this.camera = choice("Camera", views, this.usualView(), () => this.redraw());
    const numbers = Object.fromEntries(seeds.map((number) => [number, String(number)]));
    const choices = [
      choice("Robot", robots, this.robot, (value) => {
        this.camera.select.value = this.usualView(value);
        set("robot")(value);
      }),
      choice("Trained with seed", numbers, this.seed, set("seed", Number)),
      choice("Policies from", { end: "the end of training", start: "its start" }, "end", set("untrained", (x) => x === "start")),
      choice("Speed", inbounds.live.Show.SPEEDS, "1", (value) => (this.rate = Number(value))),
      this.camera,
    ];
    this.play = button("", () => this.setPlaying(!this.playing));
    const buttons = [
      this.play,
      button("One step", () => this.step()),
      button("New start", () => this.restart(this.start + 1)),
      button("Same start again", () => this.restart(this.start)),
    ];
    this.says = make("p", { className: "inbounds-live-says", "aria-live": "polite" });
    this.stage = this.element.querySelector(".inbounds-live-stage");
    this.stage.replaceChildren(
      make("div", { className: "inbounds-live-controls" }, ...choices.map((each) => each.node)),
      make("div", { className: "inbounds-live-buttons" }, ...buttons),
      make("div", { className: "inbounds-live-pair" }, ...this.panels.map((panel) => panel.node)),
      this.says,
      make("p", { className: "inbounds-live-licences" }, make("a", { href: `${inbounds.live.folder}licences.txt` }, "Licences"), " of MuJoCo, three.js and the robots' models."),
    );
  }

  usualView(robot = this.robot) {
    return robot === "Swimmer" ? "above" : "side";
  }

  async open() {
    await this.change(true);
    this.stage.hidden = false;
    const film = this.element.querySelector(".inbounds-live-film");
    film.hidden = true;
    film.querySelectorAll("video").forEach((video) => video.pause());
    this.watch();
    this.setPlaying(this.playing);
    if (!this.playing) this.say("It waits, because your system asks for reduced motion: press Play.");
  }

  // Off screen and in a hidden tab nothing runs; colours follow the theme.
  watch() {
    new IntersectionObserver((entries) => {
      this.visible = entries[entries.length - 1].isIntersecting;
      this.wake();
    }).observe(this.stage);
    document.addEventListener("visibilitychange", () => this.wake());
    new MutationObserver(() => {
      this.colors = null;
      this.redraw();
    }).observe(document.documentElement, { attributeFilter: ["data-theme"] });
    new ResizeObserver(() => this.redraw()).observe(this.stage);
  }

  // Another robot, seed or policy: bring it in and start anew. Changes that come meanwhile wait for their turn.
  change(first = false) {
    const { policies } = inbounds.live.catalogue;
    const before = (this.changing ?? Promise.resolve()).catch(() => {}); // what failed was said, and is over
    const turn = (this.turn = (this.turn ?? 0) + 1);
    this.changing = before.then(async () => {
      if (turn !== this.turn) return; // a later choice waits: only that one is carried out
      this.busy = true;
      const { robot, seed, untrained } = this;
      try {
        for (const [i, panel] of this.panels.entries()) {
          panel.which.fill(i ? { "": "none", ...policies } : policies, panel.policy);
          await panel.open(this.mujoco, robot, seed, untrained);
        }
      } catch (error) {
        for (const panel of this.panels) panel.close();
        throw error;
      } finally {
        this.busy = false;
      }
      this.say(""); // of what was there before
      this.restart(this.start);
      this.wake();
    });
    if (first) return this.changing;
    return this.changing.catch((error) => {
      this.say(`That could not be loaded (${error.message}): choose another.`);
    });
  }

  get players() {
    return this.panels.map((panel) => panel.player).filter(Boolean);
  }

  restart(start) {
    this.start = start;
    for (const player of this.players) {
      player.world.pushed = null;
      player.reset(start);
    }
    Object.assign(this, { owed: 0, rest: inbounds.live.Show.PAUSE, silence: 0, told: false, pushing: 0 });
    this.redraw();
  }

  setPlaying(playing) {
    this.playing = playing;
    this.play.textContent = playing ? "Pause" : "Play";
    this.speak();
    this.wake();
  }

  // Whether there is a robot to move: not while one is being loaded, and not after none could be.
  get ready() {
    return !this.busy && this.players.length > 0;
  }

  get runs() {
    return this.playing && this.visible && !document.hidden && this.ready;
  }

  wake() {
    if (this.frame || !this.runs) return;
    this.last = performance.now();
    this.frame = requestAnimationFrame((now) => this.tick(now));
  }

  tick(now) {
    this.frame = null;
    const seconds = Math.min(Math.max(now - this.last, 0), 100) / 1000;
    this.last = now;
    if (this.runs) this.run(seconds * this.rate);
    this.draw();
    if (this.runs) this.frame = requestAnimationFrame((next) => this.tick(next));
  }

  // Let simulated time pass; on a slow machine less of it than was asked for.
  run(seconds) {
    const deadline = performance.now() + 30;
    const [{ world }] = this.players;
    this.owed += seconds;
    while (this.owed >= world.timestep && performance.now() < deadline) {
      this.owed -= world.timestep;
      this.advance();
    }
    this.owed = Math.min(this.owed, 2 * world.dt);
    this.silence += seconds / this.rate;
    if (this.silence > inbounds.live.Show.EVERY) this.speak();
    if (!this.players.every((player) => player.over)) return;
    if (!this.told) this.speak();
    this.told = true;
    this.rest -= seconds / this.rate;
    if (this.rest < 0) this.restart(this.start + 1);
  }

  // One step of the physics for both; a push ends when its time is over.
  advance() {
    this.pushing -= this.players[0].world.timestep;
    for (const player of this.players) {
      if (this.pushing <= 0) player.world.pushed = null;
      player.advance();
    }
  }

  // One step of the environment, while paused.
  step() {
    if (this.playing) this.setPlaying(false);
    if (!this.ready) return;
    const { frame_skip: count } = this.players[0].world.task;
    for (let i = 0; i < count; i++) this.advance();
    this.redraw();
    this.speak();
  }

  // Push all robots alike, to the right and up on the picture, in units of the robot's weight.
  push(right, up) {
    const size = Math.hypot(right, up);
    if (!size || this.busy) return;
    const strength = (9.81 * Math.min(size, 2)) / size;
    for (const { scene, player } of this.panels) {
      if (!player) continue;
      const force = scene.direction(right, up).map((x) => x * strength * player.world.totalMass);
      player.world.pushed = { body: 1, force: [...force, 0, 0, 0] };
    }
    this.pushing = inbounds.live.Show.PUSH;
    this.redraw();
  }

  speak() {
    this.silence = 0;
    if (!this.ready) return;
    this.say(this.panels.filter((panel) => panel.player).map((panel) => panel.sentence()).join(" "), !this.playing);
  }

  // Aloud, a screen reader reads it at once; what changes by itself, every few seconds, would never let it finish.
  say(text, aloud = true) {
    this.says.setAttribute("aria-live", aloud ? "polite" : "off");
    this.says.textContent = text;
  }

  redraw() {
    if (this.frame || this.busy) return;
    this.drawing ??= requestAnimationFrame(() => {
      this.drawing = null;
      this.draw();
    });
  }

  draw() {
    if (this.busy) return;
    this.colors ??= this.readColors();
    const view = inbounds.live.VIEWS[this.camera.select.value];
    for (const panel of this.panels) panel.draw(this.colors, view);
  }

  // A canvas knows nothing of style sheets: the page's colours, and the families'.
  readColors() {
    const style = getComputedStyle(this.element);
    const names = ["ink", "line", "box", "clip", "sky", "gaussian", "beta", "logit-normal"];
    const colors = Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--inbounds-live-${name}`).trim()]));
    return { ...colors, font: style.fontFamily };
  }
};
