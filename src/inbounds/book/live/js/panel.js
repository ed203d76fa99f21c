// One robot on the page: which policy moves it and how it acts, its picture, its read-outs, its motors.
"use strict";

inbounds.live.Panel = class {
  static ROWS = {
    total: "Return",
    speed: "Speed",
    seconds: "Time",
    atBounds: "Actions at a bound",
    beyond: "Draws outside the box",
  };

  static STILL = 5; // pixels: a pointer that moved less has clicked

  // show: the inbounds.live.Show it belongs to; policy: of the catalogue, such as ppo-gaussian, or "" for none; way: to act.
  constructor(show, title, policy, way) {
    const { make, choice, slider, button } = inbounds.live.dom;
    this.show = show;
    this.title = title;
    this.policy = policy;
    const restart = () => show.change();
    this.which = choice(title, {}, policy, (value) => {
      this.policy = value;
      restart();
    });
    this.way = choice("acts by", { [way]: "" }, way, (value) => this.player && (this.player.way = value));
    this.spread = slider(
      "noise ×",
      { min: 0, max: 3, step: 0.05, value: 1, text: (x) => x.toFixed(2) },
      (value) => {
        this.player?.widen(value);
        show.redraw();
      },
    );
    this.picture = make("canvas");
    this.view = button("", (event) => event.detail === 0 && show.push(-1, 0));
    this.view.className = "inbounds-live-view";
    this.view.replaceChildren(this.picture);
    this.cells = {};
    const rows = Object.entries(inbounds.live.Panel.ROWS).map(([key, text]) =>
      make("tr", {}, make("th", { scope: "row" }, text), (this.cells[key] = make("td"))),
    );
    this.state = make("p", { className: "inbounds-live-state" });
    this.motors = make("canvas", { role: "img" });
    this.body = make(
      "div",
      { className: "inbounds-live-body" },
      make("div", { className: "inbounds-live-controls" }, this.way.node, this.spread.node),
      this.view,
      this.state,
      make("table", {}, make("tbody", {}, ...rows)),
      this.motors,
    );
    this.node = make("div", { className: "inbounds-live-one", role: "group", "aria-label": title }, this.which.node, this.body);
    this.listen();
  }

  // A drag on the picture pushes, and so do the arrow keys; a click or tap pushes away from its side of the picture.
  listen() {
    const KEYS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    this.view.addEventListener("keydown", (event) => {
      if (!(event.key in KEYS) || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      this.show.push(...KEYS[event.key]);
    });
    let from = null;
    this.view.addEventListener("pointerdown", (event) => {
      from = [event.clientX, event.clientY];
      this.view.setPointerCapture(event.pointerId);
    });
    this.view.addEventListener("pointermove", (event) => {
      if (from) this.show.push((event.clientX - from[0]) / 100, (from[1] - event.clientY) / 100);
    });
    this.view.addEventListener("pointerup", (event) => {
      const { left, width } = this.view.getBoundingClientRect();
      const dragged = !from || Math.hypot(event.clientX - from[0], event.clientY - from[1]) > inbounds.live.Panel.STILL;
      if (!dragged) this.show.push(event.clientX < left + width / 2 ? 1 : -1, 0);
      from = null;
    });
    this.view.addEventListener("pointercancel", () => (from = null));
  }

  // Bring in a policy and its robot. Whatever was there goes.
  async open(mujoco, robot, seed, untrained) {
    this.close();
    this.body.hidden = !this.policy;
    if (!this.policy) return;
    const { live } = inbounds;
    const policy = await live.policyOf(robot, this.policy, seed, untrained);
    const world = new live.World(mujoco, live.robots[robot]);
    try {
      world.reset(new live.Noise(0));
      this.scene = new live.Scene(this.freshCanvas(), world);
    } catch (error) {
      world.delete();
      throw error;
    }
    this.player = new live.Player(world, policy);
    this.densities = new live.Densities(this.motors, live.robots[robot].motors, policy.family);
    this.way.fill(Object.fromEntries(live.catalogue.ways[policy.family].map((way) => [way, live.WAYS[way]])), this.way.select.value);
    this.player.way = this.way.select.value;
    this.player.spread = Number(this.spread.input.value);
    this.family = policy.family;
    this.node.dataset.family = policy.family;
    const name = live.catalogue.policies[this.policy];
    this.view.setAttribute("aria-label", `${live.robots[robot].name} moved by ${name}. Arrow keys push it, and so does a drag; a click pushes it away.`);
    this.motors.setAttribute("aria-label", `For each motor of ${name}: the density of its action, what was drawn and what was executed.`);
  }

  // A canvas keeps the WebGL context that it once had, even a lost one.
  freshCanvas() {
    const canvas = document.createElement("canvas");
    this.picture.replaceWith(canvas);
    this.picture = canvas;
    return canvas;
  }

  close() {
    this.scene?.dispose();
    this.player?.world.delete();
    this.player = this.scene = this.densities = null;
    this.body.hidden = true;
  }

  draw(colors, view) {
    if (!this.player) return;
    this.scene.view = view;
    this.scene.draw(colors.sky);
    const style = { ...colors, curve: colors[this.family] };
    this.densities.draw(this.player.parameters, this.player.told, style);
    const now = this.player.readings();
    const percent = (share) => `${(100 * share).toFixed(0)} %`;
    const texts = {
      total: now.total.toFixed(0),
      speed: `${now.speed.toFixed(1)} m/s`,
      seconds: `${now.seconds.toFixed(2)} s`,
      atBounds: percent(now.atBounds),
      beyond: percent(now.beyond),
    };
    for (const [key, text] of Object.entries(texts)) this.cells[key].textContent = text.replace("-", "−");
    this.state.textContent = now.over ? `The episode is over: it ${now.over} after ${now.seconds.toFixed(1)} s.` : "";
  }

  // The same in a sentence, for a screen reader.
  sentence() {
    const now = this.player.readings();
    const end = now.over ? `, and ${now.over}` : "";
    return (
      `${inbounds.live.catalogue.policies[this.policy]}: return ${now.total.toFixed(0)} after ${now.seconds.toFixed(0)} seconds` +
      `, ${(100 * now.atBounds).toFixed(0)} % of actions at a bound${end}.`
    );
  }
};
