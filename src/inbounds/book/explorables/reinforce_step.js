// One step of REINFORCE: one state, one step, the law N(0, 1) of the latent z, the reward 1 + exp(-(z - peak)^2 / (2 w^2)).
//
// A draw's contribution is its score in (mu, log sigma) times its reward less the baseline; a batch takes the mean. The
// product of a Normal density and a bump is another Normal density times a number, so every moment has a closed form.
"use strict";

inbounds.reinforceStep = (() => {
  const WIDTH = 0.8;
  const BATCHES = 200;
  const MOST = 64; // draws in a batch

  const bump = (z, peak) => Math.exp(-0.5 * ((z - peak) / WIDTH) ** 2);

  // E[bump^power], and the mean and standard deviation of u = (z - mu)/sigma under the law with the density in proportion.
  function tilted(mu, sigma, peak, power) {
    const narrow = WIDTH ** 2 / power;
    const total = narrow + sigma ** 2;
    const mass = Math.sqrt(narrow / total) * Math.exp(-0.5 * ((mu - peak) ** 2 / total));
    return { mass, centre: (sigma * (peak - mu)) / total, spread: Math.sqrt(narrow / total) };
  }
  const expected = (mu, sigma, peak) => 1 + tilted(mu, sigma, peak, 1).mass;

  // E[bump^power u^k] for k = 0 to 4, u as above and (mu, sigma) = (0, 1).
  function moments(peak, power) {
    if (power === 0) return [1, 0, 1, 0, 3];
    const { mass, centre: d, spread: q } = tilted(0, 1, peak, power);
    const raw = [1, d, d * d + q * q, d ** 3 + 3 * d * q * q, d ** 4 + 6 * d * d * q * q + 3 * q ** 4];
    return raw.map((moment) => mass * moment);
  }

  // The gradient of the expected reward, and the covariance of one draw's contribution about it.
  function exact(peak, baseline) {
    const [flat, once, twice] = [0, 1, 2].map((power) => moments(peak, power));
    const rest = 1 - baseline;
    const paid = once.map((moment, k) => moment + rest * flat[k]); // E[(r - b) u^k]
    const square = twice.map((moment, k) => moment + 2 * rest * once[k] + rest * rest * flat[k]);
    const gradient = [paid[1], paid[2] - paid[0]];
    const covariance = [
      square[2] - gradient[0] ** 2,
      square[3] - square[1] - gradient[0] * gradient[1],
      square[4] - 2 * square[2] + square[0] - gradient[1] ** 2,
    ];
    return { gradient, covariance };
  }

  // The same draws for everyone: Lehmer's generator and Box-Muller pairs, seeded by the batch's number.
  function draws(batch) {
    let state = 12345 + 7919 * batch;
    const uniform = () => (state = (48271 * state) % 2147483647) / 2147483647;
    for (let i = 0; i < 10; i++) uniform();
    const found = [];
    while (found.length < MOST) {
      const radius = Math.sqrt(-2 * Math.log(uniform()));
      const angle = 2 * Math.PI * uniform();
      found.push(radius * Math.cos(angle), radius * Math.sin(angle));
    }
    return found;
  }
  const all = Array.from({ length: BATCHES }, (_, i) => draws(i + 1));

  function sampled(batch, count, peak, baseline) {
    const sums = [0, 0];
    for (const z of all[batch - 1].slice(0, count)) {
      const weight = (1 + bump(z, peak) - baseline) / count;
      sums[0] += weight * z;
      sums[1] += weight * (z * z - 1);
    }
    return sums;
  }

  // The program's law clips log sigma to [-10, 1].
  const after = (gradient, rate) => ({
    mu: rate * gradient[0],
    sigma: Math.exp(Math.min(1, Math.max(-10, rate * gradient[1]))),
  });
  return { BATCHES, bump, expected, exact, all, sampled, after };
})();

inbounds.models["reinforce-step"] = ({ peak, draws, batch, share, rate }) => {
  const { BATCHES, bump, expected, exact, all, sampled, after } = inbounds.reinforceStep;
  const { normalPdf } = inbounds.numerics;
  const before = expected(0, 1, peak);
  const baseline = share * before;
  const { gradient, covariance } = exact(peak, baseline);
  const ours = sampled(batch, draws, peak, baseline);
  const laws = { old: { mu: 0, sigma: 1 }, sampled: after(ours, rate), exact: after(gradient, rate) };
  const names = Object.keys(laws);
  const values = names.map((name) => expected(laws[name].mu, laws[name].sigma, peak));
  const deviation = (variance) => rate * Math.sqrt(variance / draws);
  const spreads = [deviation(covariance[0]), deviation(covariance[2])];

  const x = Array.from({ length: 321 }, (_, i) => -4 + 0.025 * i);
  const sources = {
    reward: { x, y: x.map((z) => 1 + bump(z, peak)) },
    baseline: { x: [-4, 4], y: [baseline, baseline] },
  };
  const drawn = all[batch - 1].slice(0, draws);
  sources.draws = { x: drawn, y: drawn.map((z) => 1 + bump(z, peak)) };
  for (const name of names) {
    const { mu, sigma } = laws[name];
    const points = [...x, ...x.map((t) => mu + sigma * t)].filter((z) => Math.abs(z) <= 4).sort((a, b) => a - b);
    sources[name] = { x: points, y: points.map((z) => normalPdf((z - mu) / sigma) / sigma) };
  }
  const highest = Math.min(2, Math.max(...names.flatMap((name) => sources[name].y)));

  const cloud = Array.from({ length: BATCHES }, (_, i) => sampled(i + 1, draws, peak, baseline));
  sources.cloud = { x: cloud.map(([a]) => a), y: cloud.map(([, b]) => b) };
  sources["arrow-sampled"] = { x: [0, ours[0]], y: [0, ours[1]] };
  sources["arrow-exact"] = { x: [0, gradient[0]], y: [0, gradient[1]] };
  sources["end-sampled"] = { x: [ours[0]], y: [ours[1]] };
  sources["end-exact"] = { x: [gradient[0]], y: [gradient[1]] };
  // Two standard deviations about the exact gradient, by the Cholesky factor of the covariance of a batch's mean.
  const first = Math.sqrt(covariance[0]);
  const mixed = covariance[1] / first;
  const second = Math.sqrt(Math.max(0, covariance[2] - mixed * mixed));
  const round = Array.from({ length: 73 }, (_, i) => (Math.PI * i) / 36);
  const scale = 2 / Math.sqrt(draws);
  sources.ellipse = {
    x: round.map((t) => gradient[0] + scale * first * Math.cos(t)),
    y: round.map((t) => gradient[1] + scale * (mixed * Math.cos(t) + second * Math.sin(t))),
  };

  const number = (v) => inbounds.numerics.number(v, 3);
  const steps = [ours, gradient].map((each) => each.map((v) => number(rate * v)));
  const verb = (value) => (value > before + 5e-4 ? "raises" : value < before - 5e-4 ? "lowers" : "hardly changes");
  const bare = exact(peak, 0).covariance[0];
  const taken = 1 - covariance[0] / bare;
  return {
    sources,
    ranges: { density: [0, 1.1 * highest] },
    table: {
      expected: values.map(number),
      mu: names.map((name) => number(laws[name].mu)),
      sigma: names.map((name) => number(laws[name].sigma)),
      step_loc: ["–", ...steps.map(([a]) => a)],
      spread_loc: ["–", number(spreads[0]), number(0)],
      step_log_scale: ["–", ...steps.map(([, b]) => b)],
      spread_log_scale: ["–", number(spreads[1]), number(0)],
    },
    note:
      `This batch's step ${verb(values[1])} the expected reward, ` +
      (verb(values[1]) === verb(values[2]) ? "and so does the exact step. " : `the exact step ${verb(values[2])} it. `) +
      `Steps of ${draws === 1 ? "one draw" : `${draws} draws`} have the exact step as their mean, and in μ a standard ` +
      `deviation of ${number(spreads[0])}. ` +
      (baseline === 0
        ? "No baseline is subtracted: every draw is made more probable."
        : `The baseline of ${number(baseline)} takes ${(100 * taken).toFixed(0)} % of the variance in μ, and leaves the mean alone.`),
    found: { before, baseline, gradient, covariance, sampled: ours, laws, values, spreads, taken }, // for the tests
  };
};
