// What a stored action has forgotten of its latent: z is drawn from N(mu, sigma^2), executed as a = tanh(z/2), stored in
// a floating-point format, and computed back.
//
// From log 3 on the action lies in [1/2, 1], where a format of n bits has the numbers 1 - k D with D = 2^-n. So the
// record is the integer k nearest to y/D, y = 1 - a = 2/(1 + e^z), and the latent of 1 - y is log((2 - y)/y).
"use strict";

inbounds.models["stored-action"] = ({ z, noise, log_sigma, form }) => {
  const spacing = 2 ** -[8, 11, 24, 53][form];
  const sigma = Math.exp(log_sigma);
  const mu = z - sigma * noise;
  const latentAt = (y) => (y > 0 ? Math.log((2 - y) / y) : Infinity);
  const distance = 2 / (1 + Math.exp(z));
  const steps = Math.round(distance / spacing);
  const stored = steps * spacing;
  const recalled = latentAt(stored);
  const lost = steps === 0;
  const cell = [latentAt((steps + 0.5) * spacing), latentAt((steps - 0.5) * spacing)]; // all latents with this record

  const density = (x) => inbounds.numerics.normalPdf((x - mu) / sigma) / sigma;
  const logDensity = (x) => -0.5 * ((x - mu) / sigma) ** 2 - log_sigma - 0.5 * Math.log(2 * Math.PI);
  const score = (x) => (x - mu) / sigma ** 2;
  const ratio = Math.exp(logDensity(recalled) - logDensity(z));

  // The window has the policy and both latents in it.
  const ends = [mu - 4 * sigma, mu + 4 * sigma, ...(lost ? [] : [recalled])];
  const [left, right] = [Math.min(...ends), Math.max(...ends)];
  const [top, rug] = [1.15 * density(mu), 0.07 * density(mu)];
  const x = Array.from({ length: 161 }, (_, i) => left + ((right - left) * i) / 160);
  const clip = (at) => Math.min(Math.max(at, left), right);
  const bar = (from, to, height) =>
    to > from ? { x: [0.5 * (from + to)], width: [to - from], top: [height] } : { x: [], width: [], top: [] };
  const finest = Math.ceil(100 / (right - left)); // beyond this k the ticks would touch
  const ticks = Array.from({ length: finest }, (_, i) => latentAt((i + 1) * spacing)).filter((at) => at >= left && at <= right);
  const stem = (at) => (Number.isFinite(at) ? { x: [at, at], y: [0, density(at)] } : { x: [], y: [] });
  const ring = (at) => (Number.isFinite(at) ? { x: [at], y: [density(at)] } : { x: [], y: [] });

  const number = (v, digits = 3) => inbounds.numerics.number(v, digits);
  const short = (v) => {
    if (v === 0) return "0";
    if (v >= 0.01 && v < 1e6) return number(v, v >= 100 ? 0 : 3);
    const [digits, power] = v.toExponential(2).split("e");
    return `${digits}·10${power.replace("+", "").replace(/./g, (c) => (c === "-" ? "⁻" : "⁰¹²³⁴⁵⁶⁷⁸⁹"[c]))}`;
  };
  const error = Math.abs(recalled - z);
  const about = (v) => (v < 1e-12 ? "less than 10⁻¹²" : short(v)); // the browser counts in float64 itself
  const note = lost
    ? `The stored action is the bound itself, as for every latent above ${number(cell[0], 1)}. The latent that comes ` +
      "back is infinite, and with it the score; the ratio is 0."
    : `The stored action is ${steps < 1e6 ? steps : short(steps)} ` +
      `representable number${steps === 1 ? "" : "s"} below the bound, as for all latents in an interval of length ` +
      `${about(cell[1] - cell[0])}. The latent comes back off by ${about(error)}, which is ${about(error / sigma)} σ: ` +
      `the ratio at unchanged parameters, which should be 1, is off by ${about(Math.abs(ratio - 1))}.`;
  return {
    sources: {
      density: { x, y: x.map(density) },
      cell: bar(clip(cell[0]), clip(cell[1]), top),
      dense: bar(left, clip(latentAt((finest + 1) * spacing)), rug),
      ticks: { x0: ticks, x1: ticks, y0: ticks.map(() => 0), y1: ticks.map(() => rug) },
      drawn: stem(z),
      recalled: stem(recalled),
      "drawn-top": ring(z),
      "recalled-top": ring(recalled),
    },
    ranges: { x: [left, right], y: [0, top] },
    table: {
      latent: [number(z), number(recalled)],
      action: [number(1 - distance, 9), lost ? "1, the bound" : number(1 - stored, 9)],
      distance: [short(distance), short(stored)],
      log_density: [number(logDensity(z)), number(logDensity(recalled))],
      score: [number(score(z)), number(score(recalled))],
      ratio: [number(1), number(ratio)],
    },
    note,
    record: { steps, distance, stored, recalled: lost ? "inf" : recalled, cell, ratio, mu, sigma }, // for the tests
  };
};
