// An old and a new policy as Normal laws of the latent, and what three maps make of the pair: the identity (a Gaussian
// as it is drawn), the squash a = tanh(z/2) (a logit-normal on [-1, 1]), and the clip to [-1, 1].
//
// The squash is a bijection, so it must leave every f-divergence alone. To show it and not to assume it, the divergences
// of the squashed pair are integrated over actions, from the densities that are drawn. Those of the Gaussian pair come from
// the latents; those of the clipped pair sum over both bounds and integrate between them.
"use strict";

inbounds.models["kl-of-two-policies"] = ({ mu_old, log_sigma_old, mu_new, log_sigma_new }) => {
  const { clippedGaussian, logitNormal, logNormalPdf, normalPdf } = inbounds.numerics;
  const pair = [
    { mu: mu_old, sigma: Math.exp(log_sigma_old) },
    { mu: mu_new, sigma: Math.exp(log_sigma_new) },
  ];
  const maps = ["gaussian", "logit-normal", "clipped-gaussian"];

  // Points that follow the mass of both laws, beside some that are evenly spread.
  const spread = (transform, even) => {
    const points = new Set(even);
    for (const { mu, sigma } of pair) for (let t = -8; t <= 8; t += 0.01) points.add(transform(mu + sigma * t));
    return [...points].sort((a, b) => a - b);
  };
  const evenly = (to, steps) => Array.from({ length: steps + 1 }, (_, i) => to * ((2 * i) / steps - 1));
  const grids = {
    gaussian: spread((z) => z, evenly(9, 200)),
    "logit-normal": spread((z) => Math.tanh(0.5 * z), evenly(0.999, 400)).filter((a) => Math.abs(a) < 1),
    "clipped-gaussian": spread((z) => Math.min(1, Math.max(-1, z)), evenly(1, 400)),
  };
  const gaussian = ({ mu, sigma }) => ({
    density: (z) => normalPdf((z - mu) / sigma) / sigma,
    logDensity: (z) => logNormalPdf(z, mu, sigma),
    mean: mu,
  });
  const laws = {
    gaussian: pair.map(gaussian),
    "logit-normal": pair.map(({ mu, sigma }) => logitNormal(mu, sigma)),
    "clipped-gaussian": pair.map(({ mu, sigma }) => clippedGaussian(mu, sigma)),
  };

  // Sum over the bounds of f(log p, log q), plus its integral between them by Gauss's two points in each step of the drawn
  // curves. Of logarithms: far out a density is lost in rounding where its logarithm still counts.
  const integrate = (map, f) => {
    const x = grids[map];
    const [p, q] = laws[map];
    let sum = p.logAtLow === undefined ? 0 : f(p.logAtLow, q.logAtLow) + f(p.logAtHigh, q.logAtHigh);
    for (let i = 1; i < x.length; i++) {
      const [middle, half] = [0.5 * (x[i] + x[i - 1]), 0.5 * (x[i] - x[i - 1])];
      for (const a of [middle - half / Math.sqrt(3), middle + half / Math.sqrt(3)]) sum += half * f(p.logDensity(a), q.logDensity(a));
    }
    return sum;
  };
  const divergence = (p, q) => Math.exp(p) * (p - q);
  const surprise = (p) => -Math.exp(p) * p;
  const results = Object.fromEntries(
    maps.map((map) => [
      map,
      {
        kl: integrate(map, divergence),
        reverse: integrate(map, (p, q) => divergence(q, p)),
        variation: integrate(map, (p, q) => 0.5 * Math.abs(Math.exp(p) - Math.exp(q))),
        entropy: [integrate(map, surprise), integrate(map, (p, q) => surprise(q))],
        mean: laws[map].map((law) => law.mean),
      },
    ]),
  );

  const number = (v, digits = 3) => inbounds.numerics.number(v, digits);
  // Which of the last rows differ from map to map, in the digits that are shown.
  const moved = [["entropy", "entropies"], ["mean", "means"]]
    .filter(([key]) => [0, 1].some((i) => new Set(maps.map((map) => number(results[map][key][i]))).size > 1))
    .map(([, name]) => name)
    .join(" and ");
  const short = (v) => number(v, v < 10 ? 3 : v < 100 ? 1 : 0); // no more than the quadrature knows
  const cells = (read) => maps.map((map) => short(read(results[map])));
  const lost = 1 - results["clipped-gaussian"].kl / results.gaussian.kl;
  const sources = {};
  for (const map of maps) {
    const x = grids[map];
    ["old", "new"].forEach((role, i) => (sources[`${map}-${role}`] = { x, y: x.map(laws[map][i].density) }));
  }
  const [p, q] = laws["clipped-gaussian"];
  const masses = [p.atLow, q.atLow, p.atHigh, q.atHigh];
  const places = [-1.1, -1.22, 1.1, 1.22];
  [["old", 0], ["new", 1]].forEach(([role, i]) => {
    sources[`atoms-${role}`] = { x: [places[i], places[i + 2]], mass: [masses[i], masses[i + 2]] };
  });
  const top = (map) => 1.15 * Math.max(...["old", "new"].flatMap((role) => sources[`${map}-${role}`].y));

  return {
    sources,
    ranges: {
      "y-gaussian": [0, top("gaussian")],
      "y-logit-normal": [0, Math.min(6, top("logit-normal"))],
      "y-clipped-gaussian": [0, Math.max(1.15 * Math.max(...masses), top("clipped-gaussian"))],
    },
    table: {
      kl: cells((found) => found.kl),
      reverse: cells((found) => found.reverse),
      variation: cells((found) => found.variation),
      entropy_old: cells((found) => found.entropy[0]),
      entropy_new: cells((found) => found.entropy[1]),
      mean_old: cells((found) => found.mean[0]),
      mean_new: cells((found) => found.mean[1]),
    },
    note:
      results.gaussian.kl < 5e-7
        ? "The two policies are the same: nothing tells them apart, under any map."
        : `Squashed or not, the divergence old‖new is ${short(results.gaussian.kl)} nats. ` +
          `Clipping hides ${lost < 0.0005 ? "less than 0.1" : lost > 0.9995 ? "more than 99.9" : number(100 * lost, 1)} % of it: ` +
          "where a draw lies beyond a bound can no longer be told. " +
          `${moved[0].toUpperCase()}${moved.slice(1)} differ from map to map.`,
    results, // for the tests
  };
};
