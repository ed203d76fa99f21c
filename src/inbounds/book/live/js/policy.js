// A trained policy: observations in, actions out. Its network is two layers of tanh, its numbers those of results/.
"use strict";

// Bytes from base64 text that holds a gzip stream.
inbounds.live.unpack = async (text) => {
  const bytes = Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).arrayBuffer();
};

inbounds.live.WAYS = {
  sample: "a sample, with noise",
  mean: "its mean",
  median: "its median",
  mode: "its mode",
  "median-snapped": "its median, snapped to the nearer bound",
  "sample-snapped": "a sample, snapped to the nearer bound",
};

inbounds.live.Policy = class {
  // stored: as inbounds.book.live.export writes it; bytes: its `numbers`, unpacked: the weights in float32, layer by
  // layer (rows of W, then b), then mean and variance of the observations in float64.
  // start: the bytes of the network before training, which takes the place of the trained one.
  constructor(stored, bytes, start = null) {
    Object.assign(this, stored); // name, family, sizes, low, high, limits
    this.law = inbounds.live.laws[stored.family];
    const count = stored.sizes.slice(1).reduce((sum, out, i) => sum + out * (stored.sizes[i] + 1), 0);
    this.weights = new Float32Array(start ?? bytes, 0, count);
    const statistics = new Float64Array(bytes.slice(4 * count));
    const obs = stored.sizes[0];
    this.mean = statistics.subarray(0, obs);
    this.scale = statistics.subarray(obs).map((variance) => Math.sqrt(variance + 1e-8));
    this.centre = stored.low.map((low, i) => (low + stored.high[i]) / 2);
    this.half = stored.low.map((low, i) => (stored.high[i] - low) / 2);
  }

  // The network's outputs, two a motor.
  outputs(obs) {
    let layer = Float64Array.from(obs, (x, i) =>
      Math.fround(Math.min(Math.max((x - this.mean[i]) / this.scale[i], -10), 10)),
    );
    let at = 0;
    this.sizes.slice(1).forEach((out, depth) => {
      const next = new Float64Array(out);
      const bias = at + out * layer.length;
      for (let row = 0; row < out; row++) {
        let sum = this.weights[bias + row];
        for (let i = 0; i < layer.length; i++) sum += this.weights[at++] * layer[i];
        next[row] = depth < this.sizes.length - 2 ? Math.tanh(sum) : sum;
      }
      at += out;
      layer = next;
    });
    return layer;
  }

  // The law's parameters, one object a motor.
  parameters(obs, spread = 1) {
    const outputs = this.outputs(obs);
    return this.low.map((_, i) =>
      this.law.parameters(outputs[i], outputs[i + this.low.length], this.limits, spread),
    );
  }

  // What each motor is told, in units of half its range: `drawn` before and `executed` after the robot's clip.
  act(parameters, way, noise) {
    const [base, snapped] = way.split("-");
    const drawn = parameters.map((p, i) => (base === "sample" ? this.law.draw(p, noise[i]) : this.law[base](p)));
    const told = snapped ? drawn.map((unit) => (unit >= 0 ? 1 : -1)) : drawn;
    return { drawn, executed: told.map((unit) => Math.min(Math.max(unit, -1), 1)) };
  }

  // Executed unit actions in the robot's units and in float32, as its environment receives them.
  inBox(executed) {
    return executed.map((unit, i) => Math.fround(this.centre[i] + this.half[i] * unit));
  }
};
