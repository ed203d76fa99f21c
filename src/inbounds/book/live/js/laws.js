// What a policy family is, for one motor and in units of half the action's range: parameters from the network's two
// outputs, a draw, greedy actions, a density. Mirrors inbounds.learning.families, which tests/book/live holds it to.
//
// One standard normal number drives every family: a Normal by mu + sigma * noise, the logit-normal by the same behind
// its squash, the Beta by the quantile that has the noise's probability. So two robots can be moved by the same noise.
// `spread` multiplies sigma; of a Beta it widens the law about its mode.
"use strict";

globalThis.inbounds ??= {};
inbounds.live ??= {};

inbounds.live.laws = (() => {
  const { normalPdf, normalCdf, logGamma, betaCdf, bisect, expectation, logitNormalLatentModes } = inbounds.numerics;
  const clamp = (x, low, high) => Math.min(Math.max(x, low), high);
  const softplus = (x) => Math.max(x, 0) + Math.log1p(Math.exp(-Math.abs(x)));
  const squash = (z) => Math.tanh(z / 2);

  const normalParameters = (first, second, limits, spread) => ({
    mu: first,
    sigma: Math.exp(clamp(second, limits.log_std_min, limits.log_std_max)) * spread,
  });
  // A law without spread has no density; it is drawn as a narrow one. `near` is the unit action t spreads from its middle.
  const drawable = (sigma) => Math.max(sigma, 1e-3);

  const gaussian = {
    parameters: normalParameters,
    draw: ({ mu, sigma }, noise) => mu + sigma * noise,
    near: ({ mu, sigma }, t) => mu + drawable(sigma) * t,
    mean: ({ mu }) => mu,
    median: ({ mu }) => mu,
    mode: ({ mu }) => mu,
    density({ mu, sigma }, unit) {
      const s = drawable(sigma);
      return normalPdf((unit - mu) / s) / s;
    },
    // Probability of a draw beyond the lower and beyond the upper bound, where the robot clips it.
    beyond({ mu, sigma }) {
      const s = drawable(sigma);
      return [normalCdf((-1 - mu) / s), normalCdf((mu - 1) / s)];
    },
  };

  const logitNormal = {
    parameters: normalParameters,
    draw: ({ mu, sigma }, noise) => squash(mu + sigma * noise),
    near: ({ mu, sigma }, t) => squash(mu + drawable(sigma) * t),
    mean: ({ mu, sigma }) => expectation(squash, mu, sigma),
    median: ({ mu }) => squash(mu),
    // The higher of two peaks is on the side of mu; at a tie the upper one.
    mode({ mu, sigma }) {
      const modes = logitNormalLatentModes(mu, sigma);
      return squash(mu >= 0 ? modes[modes.length - 1] : modes[0]);
    },
    density({ mu, sigma }, unit) {
      if (Math.abs(unit) >= 1) return 0;
      const s = drawable(sigma);
      return ((normalPdf((2 * Math.atanh(unit) - mu) / s) / s) * 2) / (1 - unit * unit);
    },
    beyond: () => [0, 0],
  };

  const beta = {
    parameters(first, second, limits, spread) {
      const widened = (x) => 1 + (clamp(1 + softplus(x), 1, limits.concentration_max) - 1) / Math.max(spread, 1e-2) ** 2;
      return { alpha: widened(first), beta: widened(second), still: spread === 0 };
    },
    draw(p, noise) {
      if (p.still) return beta.mode(p);
      const share = normalCdf(noise);
      return 2 * bisect((x) => betaCdf(x, p.alpha, p.beta) - share, 0, 1) - 1;
    },
    near(p, t) {
      const total = p.alpha + p.beta;
      return beta.mode(p) + 2 * t * Math.sqrt((p.alpha * p.beta) / (total + 1)) / total;
    },
    mean: ({ alpha, beta }) => (2 * alpha) / (alpha + beta) - 1,
    median: ({ alpha, beta }) => 2 * bisect((x) => betaCdf(x, alpha, beta) - 0.5, 0, 1) - 1,
    mode: ({ alpha, beta }) => (alpha + beta > 2 ? (2 * (alpha - 1)) / (alpha + beta - 2) - 1 : 0),
    density({ alpha, beta }, unit) {
      if (Math.abs(unit) >= 1) return 0;
      const logNorm = logGamma(alpha) + logGamma(beta) - logGamma(alpha + beta) + Math.LN2;
      return Math.exp((alpha - 1) * Math.log((1 + unit) / 2) + (beta - 1) * Math.log((1 - unit) / 2) - logNorm);
    },
    beyond: () => [0, 0],
  };

  return { gaussian, beta, "logit-normal": logitNormal };
})();
