// Mean, median and mode of the logit-normal action tanh(z/2), z ~ N(mu, sigma^2): where they are, how they answer to the
// parameters, and what each is a good guess for.
"use strict";

inbounds.models["greedy-action"] = ({ mu, log_sigma }) => {
  const { expectation, logitNormal, normalPdf } = inbounds.numerics;
  const squash = (z) => Math.tanh(0.5 * z);
  const slope = (z) => 0.5 * (1 - squash(z) ** 2);
  const sigma = Math.exp(log_sigma);

  // The highest mode lies on mu's side of zero; at mu = 0 two modes may tie, and the upper one is shown.
  const centres = (m, s) => {
    const { mean, modes } = logitNormal(m, s);
    return { mean, median: squash(m), mode: m < 0 ? modes[0] : modes[modes.length - 1] };
  };
  const law = logitNormal(mu, sigma);
  const here = centres(mu, sigma);

  // Slopes in mu. The mode solves z = mu + sigma^2 tanh(z/2): by the implicit function theorem dz/dmu = 1/bend.
  const latentMode = 2 * Math.atanh(here.mode);
  const bend = 1 - sigma * sigma * slope(latentMode);
  const slopes = {
    mean: expectation(slope, mu, sigma),
    median: slope(mu),
    mode: bend > 1e-6 ? slope(latentMode) / bend : Infinity,
  };

  const number = (v, digits = 3) => inbounds.numerics.number(v, digits);
  const names = ["mean", "median", "mode"];
  const cells = (read) => names.map((name) => number(read(name)));
  const absolute = (c) => expectation((z) => Math.abs(squash(z) - c), mu, sigma, 4001);
  const rms = (c) => Math.sqrt(law.std ** 2 + (law.mean - c) ** 2);
  const errors = Object.fromEntries(names.map((name) => [name, { absolute: absolute(here[name]), rms: rms(here[name]) }]));

  // The density, where its mass is.
  const points = new Set([-1, 1]);
  for (let i = 0; i <= 400; i++) {
    for (const a of [squash(mu + sigma * (-8 + 0.04 * i)), -0.9999 + 0.0049995 * i]) {
      if (Math.abs(a) < 0.99999) points.add(a);
    }
  }
  const x = [...points].sort((a, b) => a - b);
  const y = x.map(law.density);
  const top = 1.12 * Math.min(6, Math.max(...y));

  // Each centre over mu at this sigma, and over log sigma at this mu; the mode's jump is left open.
  const overMu = Array.from({ length: 161 }, (_, i) => -4 + 0.05 * i);
  const overSigma = Array.from({ length: 121 }, (_, i) => -3 + i / 30);
  const sources = { density: { x, y }, cursor_mu: { x: [mu, mu], y: [-1, 1] }, cursor_sigma: { x: [log_sigma, log_sigma], y: [-1, 1] } };
  const acrossMu = overMu.map((m) => centres(m, sigma));
  const acrossSigma = overSigma.map((s) => centres(mu, Math.exp(s)));
  for (const name of names) {
    sources[`at_${name}`] = { x: [here[name], here[name]], y: [0, top] };
    const values = acrossMu.map((found) => found[name]);
    const jumps = name === "mode" && sigma * sigma > 2;
    sources[`mu_${name}`] = { x: overMu, y: jumps ? values.map((v, i) => (Math.abs(overMu[i]) < 1e-9 ? NaN : v)) : values };
    sources[`sigma_${name}`] = { x: overSigma, y: acrossSigma.map((found) => found[name]) };
  }
  const opposite = law.cdf(0);
  const wrongSide = mu < 0 ? 1 - opposite : opposite;

  const centred = Math.abs(mu) < 1e-9;
  const drawn = centred
    ? "The policy draws an action on either side of zero with equal probability. "
    : `The policy draws an action on the other side of zero ${wrongSide < 0.005 ? "less than 1" : number(100 * wrongSide, 0)} % of the time. `;
  const peaks = sigma * sigma <= 2
    ? "It has one peak; σ² is at most 2, and all three actions move smoothly with μ. "
    : centred
      ? "It has two peaks of one height, of which the right one is shown; σ² exceeds 2, and here the mode jumps from one to the other. "
      : law.modes.length === 2
        ? "It has two peaks; the mode is the higher one, and jumps to the other side when μ changes its sign. "
        : "It has one peak here, but σ² exceeds 2: at μ = 0 the mode jumps. ";
  const closest = centred
    ? "At μ = 0 mean and median coincide."
    : "Of the three, the mean has the smallest root mean square error, the median the smallest absolute error.";

  return {
    sources,
    ranges: { density: [0, top], over_mu: [-1.05, 1.05], over_sigma: [-1.05, 1.05] },
    table: {
      action: cells((name) => here[name]),
      absolute: cells((name) => errors[name].absolute),
      rms: cells((name) => errors[name].rms),
      slope: cells((name) => slopes[name]),
    },
    note: drawn + peaks + closest,
    centres: here, // for the tests
    slopes,
    errors,
  };
};
