// Three policies that aim at the same action with, to first order, the same noise.
//
// The logit-normal draws z ~ N(mu, sigma^2) and executes tanh(z/2). The Gaussian is what is left of it when the squash
// is replaced by its tangent at mu: N(m, s^2) with m = tanh(mu/2) and s = sigma (1 - m^2)/2. The tangent leaves the box;
// what lies outside is clipped onto the bound. The Beta has the logit-normal's executed mean and standard deviation.
"use strict";

inbounds.models["bounded-densities"] = ({ mu, log_sigma }) => {
  const { logitNormal, clippedGaussian, matchedBeta } = inbounds.numerics;
  const sigma = Math.exp(log_sigma);
  const m = Math.tanh(0.5 * mu);
  const s = 0.5 * sigma * (1 - m * m);

  const squashed = logitNormal(mu, sigma);
  const gaussian = clippedGaussian(m, s);
  const beta = matchedBeta(squashed.mean, squashed.std);
  const laws = [gaussian, beta, squashed];

  // Points that follow the mass wherever it is: quantiles of either normal, and an even grid for the rest of the box.
  const points = new Set([-1, 1]);
  for (let i = 0; i <= 400; i++) {
    const t = -8 + 0.04 * i;
    for (const a of [m + s * t, Math.tanh(0.5 * (mu + sigma * t)), -0.9999 + 0.0049995 * i]) {
      if (Math.abs(a) < 0.99999) points.add(a);
    }
  }
  const x = [...points].sort((a, b) => a - b);
  const inner = x.slice(1, -1);
  const curves = {
    gaussian: { x, y: x.map(gaussian.density) },
    beta: beta.proper ? { x: inner, y: inner.map(beta.density) } : { x: [], y: [] },
    "logit-normal": { x, y: x.map(squashed.density) },
  };
  const highest = Math.max(...Object.values(curves).flatMap((curve) => curve.y));

  const number = (v, digits = 2) => inbounds.numerics.number(v, digits);
  const inside = (a) => { // with so many digits that it is not written as a bound
    let digits = 3;
    while (Math.abs(a) < 1 && Math.abs(Number(a.toFixed(digits))) === 1) digits++;
    return number(a, digits);
  };
  const percent = (p) => (p === 0 ? "0" : p < 0.0005 ? "< 0.1 %" : `${number(100 * p, 1)} %`);
  const shape = (v) => (v < 100 ? number(v) : number(v, 0));
  const named = (values) => Object.entries(values).map(([name, v]) => `${name}\u00a0${v}`).join(", ");
  const cells = (read) => laws.map((law) => (law === beta && !beta.proper ? "–" : read(law)));
  const masses = [gaussian.atLow, gaussian.atHigh];
  const atBound = masses[0] + masses[1];
  const peaks = squashed.modes.map(inside);

  return {
    sources: {
      ...curves,
      atoms: {
        x: [-1.14, 1.14], // beside the box: a bound is a point, its bar has a width
        mass: masses,
        label: masses.map((p) => (p < 0.005 ? "" : `${(100 * p).toFixed(0)}%`)),
      },
    },
    ranges: { density: [0, 1.12 * highest] },
    table: {
      parameters: [
        named({ m: number(m, 3), s: number(s, 3) }),
        named({ α: shape(beta.alpha), β: shape(beta.beta) }),
        named({ μ: number(mu), σ: number(sigma) }),
      ],
      at_low: cells((law) => percent(law.atLow)),
      at_high: cells((law) => percent(law.atHigh)),
      near: cells((law) => percent(law.cdf(-0.99) + 1 - law.cdf(0.99))),
      mean: cells((law) => number(law.mean, 3)),
      std: cells((law) => number(law.std, 3)),
      median: cells((law) => number(law.median, 3)),
      modes: cells((law) => law.modes.map(inside).join(" and ")),
    },
    note:
      `The Gaussian executes ${atBound === 0 ? "none" : percent(atBound)} of its actions exactly at a bound. ` +
      `The logit-normal has ${peaks.length === 2 ? "two peaks" : "one peak"}, at ${peaks.join(" and ")}. ` +
      (beta.proper
        ? "The Beta has the same mean and spread, and one peak."
        : "No Beta with α, β > 1 has this mean and spread: its density would pile up at a bound."),
    laws: { gaussian, beta, "logit-normal": squashed }, // for the tests
  };
};
