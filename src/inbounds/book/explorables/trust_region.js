// A trust region in the plane of a Gaussian's two parameters, and two steps to its edge.
//
// The policy is N(0, sigma^2) and the reward of an action a is exp(-2 (a - peak)^2), so that its mean under any Gaussian
// is known exactly. A step is a pair [change of mu, change of log sigma]. The Fisher matrix is diag(1/sigma^2, 2).
"use strict";

inbounds.trustRegion = (() => {
  const WIDTH2 = 0.25; // the bump is exp(-(a - peak)^2 / (2 WIDTH2))
  const along = ([x, y], share) => [share * x, share * y];
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1];

  function worth([mu, logSigma], peak) {
    const spread = WIDTH2 + Math.exp(2 * logSigma);
    return Math.sqrt(WIDTH2 / spread) * Math.exp(-((mu - peak) ** 2) / (2 * spread));
  }

  function slope(sigma, peak) {
    const spread = WIDTH2 + sigma * sigma;
    const here = worth([0, Math.log(sigma)], peak);
    return [(here * peak) / spread, here * sigma * sigma * ((peak / spread) ** 2 - 1 / spread)];
  }

  // KL(old || new), exact and to second order.
  const exact = ([x, y], sigma) => y + 0.5 * Math.exp(-2 * y) * (1 + (x / sigma) ** 2) - 0.5;
  const quadratic = ([x, y], sigma) => 0.5 * ((x / sigma) ** 2 + 2 * y * y);

  // Both directions, each as long as the quadratic divergence allows, and what a line search keeps of them.
  function steps(sigma, peak, maxKl) {
    const start = [0, Math.log(sigma)];
    const b = slope(sigma, peak);
    const gain = ([x, y]) => worth([x, start[1] + y], peak) - worth(start, peak);
    const directions = { plain: b, natural: [sigma * sigma * b[0], b[1] / 2] };
    const found = {};
    for (const [name, direction] of Object.entries(directions)) {
      const step = along(direction, Math.sqrt(maxKl / quadratic(direction, sigma)));
      let kept = 0;
      for (let k = 0; k < 10 && !kept; k++) {
        const tried = along(step, 0.5 ** k);
        if (exact(tried, sigma) <= maxKl && gain(tried) > 0) kept = 0.5 ** k;
      }
      found[name] = {
        step, kept, predicted: dot(b, step), gain: gain(step),
        exact: exact(step, sigma), quadratic: quadratic(step, sigma),
      };
    }
    return { b, ...found };
  }

  // The set exact <= maxKl has, at every change y of log sigma between two roots, a largest change of mu on both sides.
  function egg(sigma, maxKl) {
    const farthest = (y) => 2 * Math.exp(2 * y) * (maxKl - y + 0.5) - 1; // (x / sigma)^2
    const [low, high] = [-1, 1].map((side) => inbounds.numerics.bisect(farthest, 0, side * 3));
    return ring((t) => {
      const y = 0.5 * (low + high) + 0.5 * (high - low) * Math.sin(t);
      return [Math.sign(Math.cos(t)) * sigma * Math.sqrt(Math.max(0, farthest(y))), y];
    });
  }

  function ring(point, points = 240) {
    const all = Array.from({ length: points + 1 }, (_, i) => point((2 * Math.PI * i) / points));
    return { x: all.map((p) => p[0]), y: all.map((p) => p[1]) };
  }

  const ellipse = (sigma, maxKl) =>
    ring((t) => [sigma * Math.sqrt(2 * maxKl) * Math.cos(t), Math.sqrt(maxKl) * Math.sin(t)]);

  return { worth, exact, quadratic, steps, egg, ellipse, along };
})();

inbounds.models["trust-region"] = ({ log_sigma, peak, log_max_kl }) => {
  const { steps, egg, ellipse, along } = inbounds.trustRegion;
  const [sigma, maxKl] = [Math.exp(log_sigma), Math.exp(log_max_kl)];
  const found = steps(sigma, peak, maxKl);
  const names = ["plain", "natural"];
  const half = 1.1 * (2 * maxKl) ** 0.4; // a larger region is drawn larger, a small one still well visible

  const sources = { exact: egg(sigma, maxKl), quadratic: ellipse(sigma, maxKl) };
  for (const name of names) {
    const { step, kept } = found[name];
    const at = along(step, kept);
    sources[name] = { x: [0, step[0]], y: [0, step[1]] };
    sources[`${name}-end`] = { x: [step[0]], y: [step[1]] };
    sources[`${name}-kept`] = { x: [at[0]], y: [at[1]] };
  }
  const [x, y] = found.natural.step;
  const far = (4 * half) / Math.hypot(...found.b);
  sources.level = { x: [x - far * found.b[1], x + far * found.b[1]], y: [y + far * found.b[0], y - far * found.b[0]] };

  const number = (v, digits = 4) => inbounds.numerics.number(v, digits);
  const cells = (read) => names.map((name) => number(read(found[name])));
  const share = (kept) => (kept === 1 ? "all" : kept ? `1/${1 / kept}` : "nothing");
  const cost = 1 / (2 * sigma * sigma);
  const part = found.plain.predicted / found.natural.predicted;
  const towards = names.map((name) => along(found[name].step, 1 / Math.hypot(...found[name].step)));
  const alike = Math.abs(towards[0][0] * towards[1][1] - towards[0][1] * towards[1][0]) < 0.05; // less than 3° in the picture
  const idle = towards[1].findIndex((move) => Math.abs(move) < 0.05); // a parameter that the natural step leaves alone
  const promised = part > 0.9995 ? "more than 99.9" : number(100 * part, part > 0.995 ? 1 : 0);
  const { exact, kept } = found.natural;
  return {
    sources,
    ranges: { x: [-half, half], y: [-half, half] },
    table: {
      predicted: cells((each) => each.predicted),
      gain: cells((each) => each.gain),
      quadratic: cells((each) => each.quadratic),
      exact: cells((each) => each.exact),
      kept: names.map((name) => share(found[name].kept)),
    },
    note:
      `At σ = ${number(sigma, 2)} a change of μ costs ${cost < 1.05 ? "" : `${number(cost, cost < 10 ? 1 : 0)} times `}as many nats as an equal change of log σ. ` +
      (!alike
        ? `The plain gradient does not see that, and points elsewhere: at the same quadratic divergence it is promised ${promised}\u00a0% of the natural step's gain. `
        : idle < 0
          ? "Here the plain gradient points nearly where the natural one does. "
          : `Here both gradients leave ${["μ", "log σ"][idle]} nearly alone, and point the same way. `) +
      (kept === 1
        ? "The natural step's exact divergence is within the bound, and the line search keeps all of it."
        : `The natural step's exact divergence is ${exact < 1.005 * maxKl ? "just above" : `${number(exact / maxKl, 2)} times`} the bound, and the line search keeps ${share(kept)} of it.`),
    found, // for the tests
  };
};
