// A Gaussian policy climbs the surrogate of one small batch, again and again, and is paid something else.
//
// The old policy is N(0, SIGMA^2), the reward of an action a is exp(-2 (a - PEAK)^2): the mean reward of every Gaussian is
// known exactly. A batch is n draws of the old policy, each with its true advantage and some noise, less the batch's mean.
"use strict";

inbounds.oneBatch = (() => {
  const [SIGMA, PEAK, STEPS, STEP_KL, BRAKE] = [0.5, 0.2, 100, 0.001, 0.03];

  // mulberry32, and two normal numbers from two uniform ones (Box and Muller).
  function normals(seed, count) {
    let state = seed >>> 0;
    const uniform = () => {
      state = (state + 0x6d2b79f5) >>> 0;
      let t = Math.imul(state ^ (state >>> 15), state | 1);
      t ^= t + Math.imul(t ^ (t >>> 7), t | 61);
      return (((t ^ (t >>> 14)) >>> 0) + 0.5) / 4294967296;
    };
    return Array.from({ length: count }, () => {
      const radius = Math.sqrt(-2 * Math.log(uniform()));
      const angle = 2 * Math.PI * uniform();
      return [radius * Math.cos(angle), radius * Math.sin(angle)];
    });
  }

  const worth = (mu, logSigma) => inbounds.trustRegion.worth([mu, logSigma], PEAK);
  const start = () => worth(0, Math.log(SIGMA)); // trust_region.js is loaded after this file
  const advantage = (a) => Math.exp(-2 * (a - PEAK) ** 2) - start();

  function draw(n, noise, seed) {
    const drawn = normals(seed, n).map(([action, error]) => {
      const a = SIGMA * action;
      return { a, estimate: advantage(a) + noise * error };
    });
    const mean = drawn.reduce((sum, { estimate }) => sum + estimate, 0) / n;
    return drawn.map(({ a, estimate }) => ({ a, estimate: estimate - mean }));
  }

  // Natural gradient steps on the surrogate, each worth STEP_KL nats to second order.
  function climb(batch) {
    let [mu, logSigma] = [0, Math.log(SIGMA)];
    const path = [];
    for (let k = 0; k <= STEPS; k++) {
      const sigma = Math.exp(logSigma);
      let [surrogate, sum, squares, byMu, byLog] = [0, 0, 0, 0, 0];
      const weights = batch.map(({ a, estimate }) => {
        const u = (a - mu) / sigma;
        const w = (SIGMA / sigma) * Math.exp(0.5 * (a / SIGMA) ** 2 - 0.5 * u * u);
        surrogate += w * estimate;
        sum += w;
        squares += w * w;
        byMu += (w * estimate * u) / sigma;
        byLog += w * estimate * (u * u - 1);
        return w;
      });
      path.push({
        mu, sigma, weights,
        promise: surrogate / batch.length,
        truth: worth(mu, logSigma) - start(),
        effective: (sum * sum) / squares,
        kl: inbounds.trustRegion.exact([mu, Math.log(sigma / SIGMA)], SIGMA),
      });
      const direction = [sigma * sigma * byMu, byLog / 2];
      const cost = inbounds.trustRegion.quadratic(direction, sigma);
      const length = cost > 0 ? Math.sqrt(STEP_KL / cost) : 0;
      mu += length * direction[0];
      logSigma += length * direction[1];
    }
    return path;
  }

  const stopped = (path) => path.findIndex((at) => at.kl > BRAKE);
  return { SIGMA, start, advantage, draw, climb, stopped };
})();

inbounds.models["one-batch"] = ({ steps, draws, noise, batch }) => {
  const { SIGMA, advantage, draw, climb, stopped } = inbounds.oneBatch;
  const start = inbounds.oneBatch.start();
  const { normalPdf } = inbounds.numerics;
  const drawn = draw(draws, noise, batch);
  const path = climb(drawn);
  const brake = stopped(path);
  const [now, early] = [path[steps], path[brake]];
  const most = 1 - start; // all mass on the best action

  const k = path.map((_, i) => i);
  const low = Math.min(-0.15, 1.1 * Math.min(...path.map((at) => Math.min(at.truth, at.promise))));
  const gain = [low, 1.5];
  const estimates = drawn.map(({ estimate }) => estimate);
  const [least, largest] = [Math.min(-start, ...estimates), Math.max(most, ...estimates)];
  const span = largest - least;
  const paid = [least - 0.35 * span, largest + 0.12 * span];
  const a = Array.from({ length: 401 }, (_, i) => -2 + 0.01 * i);
  // Densities stand on the floor; a third of the way up is where the old one ends, and the top is cut.
  const density = (mu, sigma) => (x) =>
    paid[0] + Math.min(1, (0.3 * SIGMA * normalPdf((x - mu) / sigma)) / (sigma * normalPdf(0))) * (paid[1] - paid[0]);
  const fine = [...a, ...a.map((x) => now.mu + 3 * x * now.sigma)].filter((x) => Math.abs(x) <= 2).sort((x, y) => x - y);

  const number = (v, digits = 2) => inbounds.numerics.number(v, digits);
  const cells = (key, digits) => [now, early].map((at) => number(at[key], digits));
  const short = (v) => (v < 10 ? v.toPrecision(2) : number(v, 0));
  const impossible = now.promise > most;
  const top = path.reduce((best, at, i) => (at.truth > path[best].truth ? i : best), 0);
  return {
    sources: {
      promise: { x: k, y: path.map((at) => at.promise) },
      truth: { x: k, y: path.map((at) => at.truth) },
      most: { x: [0, k.length - 1], y: [most, most] },
      now: { x: [steps, steps], y: gain },
      brake: { x: [brake, brake], y: gain },
      "promise-now": { x: [steps], y: [now.promise] },
      "truth-now": { x: [steps], y: [now.truth] },
      drawn: {
        x: drawn.map((each) => each.a),
        y: estimates,
        size: now.weights.map((w) => Math.min(60, Math.max(2, 8 * Math.sqrt(w)))), // the area follows the weight
      },
      advantage: { x: a, y: a.map(advantage) },
      old: { x: a, y: a.map(density(0, SIGMA)) },
      new: { x: [-2, ...fine, 2], y: [paid[0], ...fine.map(density(now.mu, now.sigma)), paid[0]] },
    },
    ranges: { gain, paid },
    table: {
      promise: cells("promise"),
      truth: cells("truth"),
      effective: cells("effective", 1),
      kl: cells("kl", 3),
      at: [`${steps}`, `${brake}`],
    },
    note:
      (steps > 1
        ? `Each step is 0.001 nats from the step before it; ${steps} of them are ${short(now.kl)} nats from the old policy, ` +
          "for a divergence grows like the square of the way. "
        : "") +
      `No policy can gain more than ${number(most)}, the thin line. ` +
      (impossible
        ? `The surrogate promises ${number(now.promise)}, which is impossible, and `
        : `The surrogate promises ${number(now.promise)}, and `) +
      `the policy gains ${number(now.truth)}. ` +
      `Of ${draws} draws ${number(now.effective, 1)} still count. ` +
      (top === path.length - 1
        ? "With this batch the true gain is largest at the last step."
        : top === 0
          ? "With this batch no step gains anything."
          : `The true gain is largest after ${top} step${top === 1 ? "" : "s"}; nothing in the batch shows where.`),
    path: path.map(({ weights, ...at }) => at), // for the tests
    batch: drawn,
    top,
  };
};
