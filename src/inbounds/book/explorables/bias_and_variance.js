// What lambda trades, in a world that is known exactly: at a fork a rover turns right or left with probability 1/2, and
// from then on every step pays a noisy reward, whose mean is +PAY on the right road and -PAY on the left.
//
// The first temporal difference is r + gamma V(road) - V(fork), the later ones are r - (1 - gamma) V(road). With the
// share `missed` of the roads' values and the error `offset` in the fork, geometric series give bias and variance.
"use strict";

inbounds.models["bias-and-variance"] = ({ lam, missed, offset, visits }) => {
  const [GAMMA, PAY, NOISE] = [0.9, 0.2, 1];
  const advantage = (GAMMA * PAY) / (1 - GAMMA); // of turning right; the gradient is half of it
  const faults = (at) => {
    const decay = GAMMA * at;
    const bias = (missed * (1 - at)) / (1 - decay); // what is missing of the gradient, as a share
    const variance = (NOISE ** 2 / (1 - decay ** 2) / advantage ** 2 + offset ** 2) / visits;
    return { bias: bias ** 2, variance, sum: bias ** 2 + variance };
  };

  const grid = Array.from({ length: 1001 }, (_, i) => i / 1000);
  const best = grid.reduce((found, at) => (faults(at).sum < faults(found).sum ? at : found), 0);
  const here = faults(lam);
  const x = grid.filter((_, i) => i % 10 === 0);
  const names = ["bias", "variance", "sum"];
  const top = [0.5, 1, 2, 3].find((edge) => Math.max(...x.map((at) => faults(at).sum)) < 0.97 * edge) ?? 3;
  const sources = { at: { x: [lam, lam], y: [0, top] }, best: { x: [best], y: [faults(best).sum] } };
  for (const name of names) {
    sources[name] = { x, y: x.map((at) => faults(at)[name]) };
    sources[`${name}-here`] = { x: [lam], y: [here[name]] };
  }
  const steps = Array.from({ length: 25 }, (_, l) => l);
  const weights = steps.map((l) => (GAMMA * lam) ** l);
  sources.weights = { x: steps, top: weights };

  const number = (v, digits = 3) => v.toFixed(digits);
  const cells = (at) => names.map((name) => number(faults(at)[name]));
  const percent = (v) => `${number(100 * v, 0)}\u202f%`;
  const first = weights.slice(0, 4).map((w) => number(w)).join(", ");
  const missing = here.bias === 0 ? "nothing" : percent(Math.sqrt(here.bias));
  const judgement =
    missed === 0
      ? "The critic is right about both roads: no λ has a bias, and λ = 0 has the least variance. "
      : `The critic misses ${percent(missed)} of a road's value; on average the estimate misses ${missing} of the gradient. ` +
        `The sum is smallest at λ = ${Number(number(best))}. `;
  const baseline =
    offset === 0
      ? ""
      : `The error at the fork, ${percent(offset)} of the advantage, adds ${number(offset ** 2 / visits)} to the variance, at every λ, and nothing to the bias.`;
  return {
    sources,
    ranges: { y: [-0.02 * top, top], weight: [0, 1.05] },
    table: { residual: cells(0), here: cells(lam), rest: cells(1), best: cells(best) },
    note: `The residuals count with ${first}, … ${judgement}${baseline}`.trim(),
    faults: { ...here, best }, // for the tests
  };
};
