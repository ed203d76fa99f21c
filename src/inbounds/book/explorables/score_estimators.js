// Three estimators of one policy gradient, over the location mu of a Gaussian whose draw z is clipped to [-1, 1].
//
// The reward of the executed action a is 1 - (a - peak)^2, and a share of its mean is subtracted as a baseline. Every
// moment is a part between the bounds, by Simpson's rule, and two parts beyond them, in closed form: there the reward is
// constant, and partial moments of the Normal do the rest.
"use strict";

inbounds.scoreEstimators = (() => {
  const { normalPdf, normalCdf } = inbounds.numerics;
  const PANELS = 200;

  // E[g(z); lower < t < upper] for z = mu + sigma t: Simpson's rule where the Normal has any mass.
  function between(g, lower, upper) {
    const [from, to] = [Math.max(lower, -9), Math.min(upper, 9)];
    if (to <= from) return 0;
    const step = (to - from) / PANELS;
    let sum = 0;
    for (let i = 0; i <= PANELS; i++) {
      const t = from + i * step;
      const weight = i === 0 || i === PANELS ? 1 : i % 2 ? 4 : 2;
      sum += weight * normalPdf(t) * g(t);
    }
    return (sum * step) / 3;
  }

  // Mass, first and second moment of a score beyond w standard deviations on one side; sign is -1 on the left.
  const beyond = {
    loc: (w, sign, sigma) => {
      const [mass, density] = [normalCdf(-w), normalPdf(w)];
      return { mass, first: (sign * density) / sigma, second: (mass + w * density) / sigma ** 2 };
    },
    log_scale: (w) => {
      const [mass, density] = [normalCdf(-w), normalPdf(w)];
      return { mass, first: w * density, second: 2 * mass + (w ** 3 + w) * density };
    },
  };
  const score = { loc: (t, sigma) => t / sigma, log_scale: (t) => t * t - 1 };

  // Mean and standard deviation of one sample of each estimator, for the gradient in one parameter.
  function moments(parameter, mu, sigma, peak, share) {
    const reward = (a) => 1 - (a - peak) ** 2;
    const [lower, upper] = [(-1 - mu) / sigma, (1 - mu) / sigma];
    const value =
      reward(-1) * normalCdf(lower) + reward(1) * normalCdf(-upper) + between((t) => reward(mu + sigma * t), lower, upper);
    const paid = (a) => reward(a) - share * value;
    const inside = [1, 2].map((power) =>
      between((t) => (paid(mu + sigma * t) * score[parameter](t, sigma)) ** power, lower, upper),
    );
    const estimators = {};
    for (const name of ["drawn", "clipped", "capg"]) {
      let [mean, square] = inside;
      for (const [bound, w, sign] of [[-1, -lower, -1], [1, upper, 1]]) {
        const { mass, first, second } = beyond[parameter](w, sign, sigma);
        const atBound = score[parameter](sign * w, sigma);
        mean += paid(bound) * (name === "clipped" ? atBound * mass : first);
        const capg = mass > 0 ? first ** 2 / mass : 0;
        square += paid(bound) ** 2 * { drawn: second, clipped: atBound ** 2 * mass, capg }[name];
      }
      estimators[name] = { mean, std: Math.sqrt(Math.max(0, square - mean * mean)) };
    }
    return { ...estimators, value, outside: normalCdf(lower) + normalCdf(-upper) };
  }
  return { moments };
})();

inbounds.models["score-estimators"] = ({ mu, log_sigma, peak, share }) => {
  const { moments } = inbounds.scoreEstimators;
  const sigma = Math.exp(log_sigma);
  const names = ["drawn", "clipped", "capg"];
  const x = Array.from({ length: 121 }, (_, i) => -2.4 + 0.04 * i);
  const curves = x.map((at) => moments("loc", at, sigma, peak, share));
  const sources = {};
  for (const name of names) {
    sources[`mean-${name}`] = { x, y: curves.map((each) => each[name].mean) };
    sources[`std-${name}`] = { x, y: curves.map((each) => each[name].std) };
  }
  const here = { loc: moments("loc", mu, sigma, peak, share), log_scale: moments("log_scale", mu, sigma, peak, share) };

  const span = (key) => {
    const values = names.flatMap((name) => sources[`${key}-${name}`].y);
    const [low, high] = [Math.min(0, ...values), Math.max(0, ...values)];
    const margin = 0.08 * (high - low || 1);
    return [low - margin, high + margin];
  };
  const ranges = { mean: span("mean"), std: span("std") };
  for (const key of ["mean", "std"]) sources[`at-${key}`] = { x: [mu, mu], y: ranges[key] };

  const number = (v) => inbounds.numerics.number(v, 3);
  const cells = (read) => names.map((name) => number(read(name)));
  const { clipped, capg } = here.loc;
  const seen = Math.min(Math.abs(clipped.mean), Math.abs(capg.mean)) >= 0.0005; // not what is zero but for rounding
  const wrong = clipped.mean - capg.mean;
  const opposite = seen && clipped.mean * capg.mean < 0;
  const varies = here.loc.drawn.std >= 0.0005;
  const saved = 1 - (capg.std / here.loc.drawn.std) ** 2;
  const percent = (p) => (p > 0 && p < 0.0005 ? "less than 0.1 %" : `${(100 * p).toFixed(1)} %`);
  return {
    sources,
    ranges,
    table: {
      mean_loc: cells((name) => here.loc[name].mean),
      bias_loc: cells((name) => here.loc[name].mean - here.loc.capg.mean),
      std_loc: cells((name) => here.loc[name].std),
      mean_log_scale: cells((name) => here.log_scale[name].mean),
      bias_log_scale: cells((name) => here.log_scale[name].mean - here.log_scale.capg.mean),
      std_log_scale: cells((name) => here.log_scale[name].std),
    },
    note:
      `At μ = ${number(mu)} and σ = ${number(sigma)}, ${percent(here.loc.outside)} of the draws leave the box, and the ` +
      `mean reward is ${number(here.loc.value)}. The score at the clipped action is off by ${number(wrong)} in μ` +
      (opposite ? ": it points the wrong way. " : ". ") +
      (varies
        ? `CAPG's variance in μ is ${percent(saved)} below that of the score at the drawn action.`
        : "No estimator varies in μ by as much as 0.0005."),
    here, // for the tests
  };
};
