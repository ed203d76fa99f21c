// A Beta policy on [-1, 1], the pairs of mean and spread that such policies reach, and a logit-normal that matches it.
//
// alpha and beta lie in [1, 80], log sigma at 1 or below: the limits of this book's policies. In the plane of mean and
// standard deviation the Betas then fill a lens, the logit-normals everything below an arch. Whoever changes one parameter
// alone moves along a path in that plane, and no path goes straight up.
"use strict";

inbounds.betaLens = (() => {
  const { bisect, expectation, logitNormal } = inbounds.numerics;
  const CAP = 80;
  const WIDEST = Math.E; // largest sigma

  const squash = (z) => Math.tanh(0.5 * z);
  const place = (alpha, beta) => {
    const [total, centre] = [alpha + beta, alpha / (alpha + beta)];
    return [2 * centre - 1, 2 * Math.sqrt((centre * (1 - centre)) / (total + 1))];
  };

  // Smallest and largest standard deviation of a Beta policy at a mean: the larger parameter is 80, or the smaller is 1.
  function betaReach(mean) {
    const near = 0.5 * (1 - Math.abs(mean));
    const far = 1 - near;
    return [2 * Math.sqrt((near * far * far) / (CAP + far)), 2 * Math.sqrt((near * near * far) / (1 + near))];
  }

  // The largest of a logit-normal policy.
  function logitNormalReach(mean) {
    const mu = bisect((at) => expectation(squash, at, WIDEST) - mean, -40, 40);
    return logitNormal(mu, WIDEST).std;
  }

  // The logit-normal with a Beta's mean and standard deviation: Newton's method in mu and log sigma, on the logit of the
  // mean and the logarithm of the spread. It starts from the logit of a Beta variable, roughly.
  function match(alpha, beta) {
    const [mean, std] = place(alpha, beta);
    let [mu, logSigma] = [Math.log(alpha / beta), 0.5 * Math.log(1 / alpha + 1 / beta)];
    for (let i = 0, step = 1; i < 50 && step > 1e-12; i++) {
      const sigma = Math.exp(logSigma);
      const average = (f) => expectation(f, mu, sigma);
      const slope = (z) => 0.5 * (1 - squash(z) ** 2);
      const away = (z) => z - mu; // the derivative of z in log sigma
      const found = average(squash);
      const centred = (z) => squash(z) - found;
      const variance = average((z) => centred(z) ** 2);
      const wrong = [2 * (Math.atanh(found) - Math.atanh(mean)), 0.5 * Math.log(variance) - Math.log(std)];
      const [byMean, byVariance] = [2 / (1 - found * found), 1 / variance];
      const a = byMean * average(slope);
      const b = byMean * average((z) => slope(z) * away(z));
      const c = byVariance * average((z) => centred(z) * slope(z));
      const d = byVariance * average((z) => centred(z) * slope(z) * away(z));
      const move = [(d * wrong[0] - b * wrong[1]) / (a * d - b * c), (a * wrong[1] - c * wrong[0]) / (a * d - b * c)];
      mu -= move[0];
      logSigma -= Math.min(1, Math.max(-1, move[1]));
      step = Math.abs(move[0]) + Math.abs(move[1]);
    }
    return { mu, sigma: Math.exp(logSigma) };
  }

  const between = (from, to, count) => Array.from({ length: count + 1 }, (_, i) => from + ((to - from) * i) / count);
  const curve = (points) => ({ x: points.map(([x]) => x), y: points.map(([, y]) => y) });
  const side = between(0, Math.log(CAP), 80).map(Math.exp);
  const back = [...side].reverse();
  const lens = curve([
    ...side.map((s) => place(s, 1)), ...side.map((s) => place(CAP, s)),
    ...back.map((s) => place(s, CAP)), ...back.map((s) => place(1, s)),
  ]);
  const arch = curve(between(-24, 24, 120).map((mu) => logitNormal(mu, WIDEST)).map(({ mean, std }) => [mean, std]));

  // Where one parameter leads when the other stays.
  const paths = (alpha, beta, mu) => ({
    alpha: curve(side.map((s) => place(s, beta))),
    beta: curve(side.map((s) => place(alpha, s))),
    sigma: curve(between(-4, 1, 40).map((s) => logitNormal(mu, Math.exp(s))).map(({ mean, std }) => [mean, std])),
  });
  return { CAP, place, betaReach, logitNormalReach, match, lens, arch, paths };
})();

inbounds.models["beta-lens"] = ({ log_alpha, log_beta }) => {
  const { CAP, place, betaReach, logitNormalReach, match, lens, arch, paths } = inbounds.betaLens;
  const { logGamma, logitNormal } = inbounds.numerics;
  const [alpha, beta] = [log_alpha, log_beta].map((v) => Math.min(CAP, Math.exp(v)));
  const [mean, std] = place(alpha, beta);
  const { mu, sigma } = match(alpha, beta);
  const squashed = logitNormal(mu, sigma);
  const [narrowest, widest] = betaReach(mean);
  const roof = logitNormalReach(mean);

  const norm = Math.exp(logGamma(alpha + beta) - logGamma(alpha) - logGamma(beta) - Math.LN2);
  const density = (a) => norm * (0.5 * (1 + a)) ** (alpha - 1) * (0.5 * (1 - a)) ** (beta - 1);
  const x = Array.from({ length: 501 }, (_, i) => -Math.cos((Math.PI * i) / 500)); // crowds the bounds
  const curves = {
    beta: { x, y: x.map(density) },
    "logit-normal": { x, y: x.map(squashed.density) },
  };
  const highest = 1.12 * Math.max(...curves.beta.y, ...curves["logit-normal"].y);
  const { alpha: byAlpha, beta: byBeta, sigma: bySigma } = paths(alpha, beta, mu);
  const ends = [byAlpha, byBeta, bySigma].map((path) => [path.x.at(-1), path.y.at(-1)]);

  const number = (v, digits = 3) => inbounds.numerics.number(v, digits);
  const named = (values) => Object.entries(values).map(([name, v]) => `${name}\u00a0${number(v, 2)}`).join(", ");
  const [least, most] = [Math.min(alpha, beta), Math.max(alpha, beta)];
  const mode =
    most < 1 + 1e-9 ? "none: flat" : number(most > 1 && least < 1 + 1e-9 ? Math.sign(alpha - beta) : (alpha - beta) / (alpha + beta - 2));

  // d log variance / d log alpha, up to a positive factor; the other by symmetry.
  const widens = (own) => 1 / own - 2 / (alpha + beta) - 1 / (alpha + beta + 1) > 0;
  const moves = (name, own, ways) => {
    const [up, back] = widens(own) ? ["wider", "narrower"] : ["narrower", "wider"];
    return own > CAP - 1e-6
      ? `${name} is at its cap, ${CAP}; less of it moves the mean ${ways[1]} and makes the law ${back}. `
      : `More ${name} moves the mean ${ways[0]} and makes the law ${up}. `;
  };
  const edge =
    most < 1 + 1e-9
      ? "This is the uniform law, the widest of all Beta policies. "
      : least < 1 + 1e-9 && most > CAP - 1e-6
        ? `One parameter is 1, the other ${CAP}: no other Beta policy has this mean. `
      : least < 1 + 1e-9
        ? "One parameter is 1: at this mean no Beta policy is wider. "
        : most > CAP - 1e-6
          ? `One parameter is ${CAP}, its cap: at this mean no Beta policy is narrower. `
          : "";
  return {
    sources: {
      ...curves,
      lens,
      arch,
      "path-alpha": byAlpha,
      "path-beta": byBeta,
      "path-sigma": bySigma,
      here: { x: [mean], y: [std] },
      "at-mean": { x: [mean, mean], y: [0, highest] },
      reach: { x: [mean, mean], y: [narrowest, widest] },
      ends: {
        x: ends.map(([at]) => at),
        y: ends.map(([, at]) => at),
        label: ["α↑", "β↑", "σ↑"],
        align: ["left", "right", "center"],
      },
    },
    ranges: { density: [0, highest] },
    table: {
      parameters: [named({ α: alpha, β: beta }), named({ μ: mu, σ: sigma })],
      mean: [mean, squashed.mean].map((v) => number(v)),
      std: [std, squashed.std].map((v) => number(v)),
      mode: [mode, squashed.modes.map((a) => number(a)).join(" and ")],
      widest: [widest, roof].map((v) => number(v)),
      narrowest: [number(narrowest), "below 0.001"],
    },
    note:
      moves("α", alpha, ["up", "down"]) + moves("β", beta, ["down", "up"]) + "Neither moves along the upright line. " +
      edge +
      `With the mean at ${number(mean, 2)}, a Beta policy has a standard deviation from ${number(narrowest)} to ` +
      `${number(widest)}, a logit-normal policy one of up to ${number(roof)}.`,
    found: { mu, sigma, mean, std, narrowest, widest, roof, highest }, // for the tests
  };
};
