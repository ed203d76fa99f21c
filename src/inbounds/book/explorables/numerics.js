// The mathematics behind the explorables: densities, masses and moments on the box [-1, 1].
//
// Every law is an object with the same fields, so that an explorable can treat them alike:
//   density(a), logDensity(a)  per unit of action, inside the box     cdf(a)   P(action <= a), without an atom at the upper bound
//   atLow, atHigh  probability of the bounds themselves
//   mean, std, median, modes (ascending)
// tests/book/explorables/test_bounded_densities.py compares all of it with the Python package and SciPy.
"use strict";

globalThis.inbounds ??= {};
inbounds.models ??= {}; // name of an explorable -> function from control values to what the page shows

inbounds.numerics = (() => {
  const LOG_SQRT_2PI = 0.5 * Math.log(2 * Math.PI);

  const normalPdf = (x) => Math.exp(-0.5 * x * x - LOG_SQRT_2PI);
  const logNormalPdf = (x, mu, sigma) => -0.5 * ((x - mu) / sigma) ** 2 - LOG_SQRT_2PI - Math.log(sigma);

  // A number as the page writes it: so many decimals, a true minus, and none before zero.
  const number = (v, digits) =>
    v.toFixed(digits).replace(/^-(?=0\.?0*$)/, "").replace("Infinity", "∞").replace("-", "−");

  // Series of Marsaglia (2004), Evaluating the Normal Distribution, Journal of Statistical Software 11(4).
  function normalCdf(x) {
    if (Math.abs(x) > 9) return x > 0 ? 1 : 0;
    let sum = x;
    let term = x;
    for (let n = 3, last = NaN; sum !== last; n += 2) {
      last = sum;
      term *= (x * x) / n;
      sum += term;
    }
    return 0.5 + sum * normalPdf(x);
  }

  // log P(z <= x), where P itself would be lost in rounding: Laplace's continued fraction for the tail (DLMF 7.9.1).
  function logNormalCdf(x) {
    if (x > -4) return Math.log(normalCdf(x));
    let below = -x;
    for (let k = 80; k > 0; k--) below = -x + k / below;
    return -0.5 * x * x - LOG_SQRT_2PI - Math.log(below);
  }

  // Stirling's series, after the recurrence has lifted the argument to where the series is exact in doubles.
  function logGamma(x) {
    let shift = 0;
    for (; x < 12; x += 1) shift -= Math.log(x);
    const y = 1 / (x * x);
    const series = (1 / 12 - y * (1 / 360 - y * (1 / 1260 - y * (1 / 1680 - y / 1188)))) / x;
    return shift + (x - 0.5) * Math.log(x) - x + LOG_SQRT_2PI + series;
  }

  const logBeta = (a, b) => logGamma(a) + logGamma(b) - logGamma(a + b);

  // Regularised incomplete beta function: DLMF 8.17.22, evaluated by the modified Lentz method.
  function betaCdf(x, a, b) {
    if (x <= 0) return 0;
    if (x >= 1) return 1;
    if (x > (a + 1) / (a + b + 2)) return 1 - betaCdf(1 - x, b, a);
    const safe = (v) => (Math.abs(v) < 1e-300 ? 1e-300 : v);
    let d = 1 / safe(1 - ((a + b) * x) / (a + 1));
    let c = 1;
    let fraction = d;
    for (let m = 1; m < 1000; m++) {
      const even = (m * (b - m) * x) / ((a + 2 * m - 1) * (a + 2 * m));
      const odd = (-(a + m) * (a + b + m) * x) / ((a + 2 * m) * (a + 2 * m + 1));
      let step = 1;
      for (const coefficient of [even, odd]) {
        d = 1 / safe(1 + coefficient * d);
        c = safe(1 + coefficient / c);
        step = c * d;
        fraction *= step;
      }
      if (Math.abs(step - 1) < 1e-15) break;
    }
    return (Math.exp(a * Math.log(x) + b * Math.log1p(-x) - logBeta(a, b)) * fraction) / a;
  }

  // A root of f between two points where its sign differs.
  function bisect(f, from, to) {
    const sign = Math.sign(f(from));
    for (let i = 0; i < 80; i++) {
      const middle = 0.5 * (from + to);
      if (Math.sign(f(middle)) === sign) from = middle;
      else to = middle;
    }
    return 0.5 * (from + to);
  }

  // E[f(z)] for z ~ N(mu, sigma^2): the trapezoid rule on +-8.5 sigma, geometrically convergent for smooth f.
  function expectation(f, mu, sigma, nodes = 241) {
    const step = 17 / (nodes - 1);
    let sum = 0;
    for (let i = 0; i < nodes; i++) {
      const t = -8.5 + i * step;
      sum += normalPdf(t) * f(mu + sigma * t);
    }
    return sum * step;
  }

  // z ~ N(mu, sigma^2), action tanh(z/2) = 2 sigmoid(z) - 1.
  function logitNormal(mu, sigma) {
    const squash = (z) => Math.tanh(0.5 * z);
    const mean = expectation(squash, mu, sigma);
    const variance = expectation((z) => (squash(z) - mean) ** 2, mu, sigma);
    const atLatent = (z) => (normalPdf((z - mu) / sigma) / sigma) * 2 * Math.cosh(0.5 * z) ** 2;
    const logAtLatent = (z) => logNormalPdf(z, mu, sigma) + Math.LN2 + 2 * Math.log(Math.cosh(0.5 * z));
    return {
      density: (a) => (Math.abs(a) < 1 ? atLatent(2 * Math.atanh(a)) : 0),
      logDensity: (a) => logAtLatent(2 * Math.atanh(a)),
      cdf: (a) => (a >= 1 ? 1 : a <= -1 ? 0 : normalCdf((2 * Math.atanh(a) - mu) / sigma)),
      atLow: 0,
      atHigh: 0,
      mean,
      std: Math.sqrt(variance),
      median: squash(mu),
      modes: logitNormalLatentModes(mu, sigma).map(squash),
    };
  }

  // The density's stationary points solve g(z) = z - mu - sigma^2 tanh(z/2) = 0. For sigma^2 <= 2, g rises and has one
  // root, the mode; beyond, g turns at +-2 artanh(k), k^2 = 1 - 2/sigma^2, and the modes are the outer roots.
  function logitNormalLatentModes(mu, sigma) {
    const s2 = sigma * sigma;
    const g = (z) => z - mu - s2 * Math.tanh(0.5 * z);
    const [left, right] = [mu - s2 - 1e-9, mu + s2 + 1e-9];
    if (s2 <= 2) return [bisect(g, left, right)];
    const turn = 2 * Math.atanh(Math.sqrt(1 - 2 / s2));
    const modes = [];
    if (g(-turn) > 0) modes.push(bisect(g, left, -turn));
    if (g(turn) < 0) modes.push(bisect(g, turn, right));
    return modes;
  }

  // N(m, s^2) as a simulator executes it: what lies beyond a bound piles up on the bound.
  function clippedGaussian(m, s) {
    const [a, b] = [(-1 - m) / s, (1 - m) / s];
    const [atLow, atHigh] = [normalCdf(a), normalCdf(-b)];
    const inside = 1 - atLow - atHigh;
    const [da, db] = [normalPdf(a), normalPdf(b)];
    const mean = atHigh - atLow + m * inside + s * (da - db);
    const square = atHigh + atLow + (m * m + s * s) * inside + s * ((m - 1) * da - (m + 1) * db);
    const clipped = Math.min(1, Math.max(-1, m));
    return {
      density: (x) => (Math.abs(x) <= 1 ? normalPdf((x - m) / s) / s : 0),
      logDensity: (x) => logNormalPdf(x, m, s),
      cdf: (x) => (x >= 1 ? 1 : x < -1 ? 0 : normalCdf((x - m) / s)),
      atLow,
      atHigh,
      logAtLow: logNormalCdf(a),
      logAtHigh: logNormalCdf(-b),
      mean,
      std: Math.sqrt(Math.max(0, square - mean * mean)),
      median: clipped,
      modes: Math.abs(m) <= 1 ? [m] : [],
    };
  }

  // The Beta on [-1, 1] with a given mean and standard deviation. `proper` says whether both parameters exceed 1, the
  // range of a Beta policy: a single peak strictly inside the box.
  function matchedBeta(mean, std) {
    const centre = 0.5 * (1 + mean);
    const total = (centre * (1 - centre)) / (0.5 * std) ** 2 - 1;
    const [alpha, beta] = [centre * total, (1 - centre) * total];
    const proper = alpha > 1 && beta > 1;
    const logNorm = logBeta(alpha, beta) + Math.LN2;
    const cdf = (a) => betaCdf(0.5 * (1 + a), alpha, beta);
    return {
      density: (a) =>
        Math.exp((alpha - 1) * Math.log(0.5 * (1 + a)) + (beta - 1) * Math.log(0.5 * (1 - a)) - logNorm),
      cdf,
      atLow: 0,
      atHigh: 0,
      mean,
      std,
      median: bisect((a) => cdf(a) - 0.5, -1, 1),
      modes: proper ? [(2 * (alpha - 1)) / (alpha + beta - 2) - 1] : [],
      alpha,
      beta,
      proper,
    };
  }

  return {
    number, normalPdf, normalCdf, logNormalPdf, logNormalCdf, logGamma, betaCdf, bisect, expectation,
    logitNormal, logitNormalLatentModes, clippedGaussian, matchedBeta,
  };
})();
